"""Where the gap lies: each block of the robot replayed on its own, driven by measured signals.

Blocks and what drives them (contract, section 2, for the equations):

- bus: the nominal supply against the measured bus voltage;
- current: command and measured speed -> current (driver and winding);
- torque: measured current -> speed, in windows of `WINDOW_S` that start at the measured speed (gear, wheels, body);
- turn, way: measured wheel speeds -> yaw rate, and wheel angles -> how the pose moves (ground contact, geometry);
- speed_twice, yaw_twice: a channel against another one of the same quantity (sensors).

Each block's residual is divided by the noise that the sensors alone would leave in it, so a perfect robot scores 1.
The blocks' residuals are linear in small errors of the robot. Shares follow from a regression of all blocks at once
on such errors' signatures, nuisances with their prior always in it: an error that explains most of what is left
hands its energy to its subsystem, and what no signature explains stays with the block it is seen in.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numba
import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Case, Robot, RunLog
from rtds_host.diagnosis.effects import SUBSYSTEMS
from rtds_host.diagnosis.replay.model import Model

WINDOW_S = 0.3
POSE_WINDOW_S = 0.5
TWICE_WINDOW_S = 1.0
PRIOR = 0.01
# Which subsystem a block's own, unexplained residual speaks of.
BLOCKS = {
    "bus": "driver", "current_l": "driver", "current_r": "driver", "torque_l": "drivetrain",
    "torque_r": "drivetrain", "turn": "wheel_ground", "way": "wheel_ground",
    "speed_twice_l": "sensing", "speed_twice_r": "sensing", "yaw_twice": "sensing",
}
TITLES = {
    "bus": "supply voltage", "current_l": "command and speed → current, left",
    "current_r": "command and speed → current, right", "torque_l": "current → speed, left",
    "torque_r": "current → speed, right",
    "turn": "wheel speeds → yaw rate", "way": "wheel angles → pose",
    "speed_twice_l": "speed against angle, left", "speed_twice_r": "speed against angle, right",
    "yaw_twice": "gyro against yaw",
}
# Signatures of the contract's nuisances, ratios all; beyond `NAMED` a ratio is a cause of its own.
NUISANCES = ("winding:resistance", "winding:constant", "drivetrain:inertia", "drivetrain:viscous")
NAMED = 0.03
DELAYS_S = (0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08)
# A signature is believed when it explains at least this share of what is left, or of what there was.
BELIEVED = 0.35
BELIEVED_OF_ALL = 0.03
# Excess energy, as a share of the noise's, below which no place is named.
FAINT = 0.05


@dataclass(frozen=True)
class Block:
    """One block: `score` root mean square residual in units of noise (a perfect robot scores 1), `n` residuals,
    `regimes` the score in each regime, `share` of all excess energy."""

    name: str
    subsystem: str
    title: str
    score: float
    n: int
    regimes: dict[str, float] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True)
class Localisation:
    """Blocks of a case, the share of each subsystem and the signatures that made it; `lost`: what missing channels
    keep from being told apart; `lag_s`: delay of `DELAYS_S` that fits the blocks best, 0 without one."""

    blocks: tuple[Block, ...]
    located: dict[str, float]
    signatures: tuple[tuple[str, str, float], ...]
    lost: tuple[str, ...]
    lag_s: float

    def shares(self) -> list[dict[str, object]]:
        """The contract's `located`: subsystems with their share, largest first, summing to 1; [] where no gap is."""
        return [{"subsystem": s, "share": v}
                for s, v in sorted(self.located.items(), key=lambda p: (-p[1], SUBSYSTEMS.index(p[0]))) if v > 0]


class _Windows:
    """Removes each window's mean from a series, so that the window's start is free."""

    def __init__(self, t: np.ndarray, length_s: float):
        index = ((t - t[0]) / length_s).astype(int)
        self.starts = np.flatnonzero(np.diff(index, prepend=-1))
        self.counts = np.diff(np.append(self.starts, len(t)))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return values - np.repeat(np.add.reduceat(values, self.starts) / self.counts, self.counts)

    def whole(self, good: np.ndarray) -> np.ndarray:
        """Rows of windows in which every row is good."""
        return np.repeat(np.logical_and.reduceat(good, self.starts), self.counts)


def _near(t: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Rows with a sample close by: filling in over a longer hole would be invention."""
    at = t[good]
    if len(at) < 2:
        return np.zeros(len(t), bool)
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    distance = np.minimum(np.abs(t - at[after - 1]), np.abs(at[after] - t))
    return distance <= 2.5 * float(np.median(np.diff(at)))


@numba.njit(cache=True)
def _first_order(drive, decay):
    out = np.zeros(len(drive))
    for j in range(len(decay)):
        out[j + 1] = decay[j] * out[j] + (1.0 - decay[j]) * drive[j + 1]
    return out


def _filled(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    good = np.isfinite(values)
    return values if good.all() else np.interp(t, t[good], values[good])


def _cum(rate: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Integral of values that hold over each interval: (n - 1,) -> (n,)."""
    return np.concatenate([[0.0], np.cumsum(rate * dt)])


def _mid(values: np.ndarray) -> np.ndarray:
    return 0.5 * (values[1:] + values[:-1])


def _relaxed(values: np.ndarray, dt: np.ndarray, tau: float) -> np.ndarray:
    """Mean over each interval of a speed that relaxes with `tau` towards where a held voltage drives it, (n - 1,).

    Between two rows of a log the command holds, so that the speed bends the more the longer the interval is
    against the mechanical time constant; the plain mean of the ends would be off by more than the noise.
    """
    decay = np.exp(-dt / tau)
    weight = (tau / dt) - decay / (1.0 - decay)
    return weight * values[:-1] + (1.0 - weight) * values[1:]


def _smooth(values: np.ndarray, half: int) -> np.ndarray:
    width = 2 * half + 1
    padded = np.concatenate([np.full(half, values[0]), values, np.full(half, values[-1])])
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return (total[width:] - total[:-width]) / width


class _Run:
    """Signals of one run, brought to its rows, with each block's residual and the signatures' columns."""

    def __init__(self, log: RunLog, robot: Robot, model: Model):
        self.log, self.robot, self.model = log, robot, model
        self.t = log.t
        self.dt = np.diff(log.t)
        self.n = len(log.t)
        self.sides = range(len(robot.sides))
        self.body = robot.chassis is not None
        self.blocks: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}  # residual, noise, rows
        self.columns: dict[str, dict[str, np.ndarray]] = {}
        self._signals()
        self._bus_block()
        for k in self.sides:
            self._current_block(k)
        for k in self.sides:
            self._torque_block(k)
        if self.body:
            self._turn_block()
            self._way_block()
        for k in self.sides:
            self._speed_twice_block(k)
        self._yaw_twice_block()

    # ---- signals -------------------------------------------------------------------------------------------------
    def _get(self, name: str) -> np.ndarray | None:
        return self.log.columns[name] if self.log.has(name) and self.robot.noise(name) is not None else None

    def _held(self, command: np.ndarray, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """A held command that acts `delay` late: its value just before each row (n,), its mean over each interval."""
        t = self.t
        if delay <= 0:
            return np.concatenate([[0.0], command[:-1]]), command[:-1]
        index = np.searchsorted(t, t - delay, side="left") - 1
        before = np.where(index >= 0, command[np.maximum(index, 0)], 0.0)
        total = _cum(command[:-1], self.dt)
        return before, np.diff(np.interp(t - delay, t, total, left=0.0)) / self.dt

    def _signals(self) -> None:
        log, robot, model, t = self.log, self.robot, self.model, self.t
        gear = model.get("gear_ratio")
        self.supply = model.get("supply")
        self.voltage_mode = robot.driver.mode == "voltage"
        self.delay = model.get("command_delay") + model.get("measurement_delay")
        self.w, self.w_noise, self.w_rows, self.th, self.i, self.has_i, self.i_rows = [], [], [], [], [], [], []
        self.v_end, self.v_mean, self.volts, self.electric = [], [], [], []
        command = log.commands(robot.driver.mode)
        self.bus = self._get("v_bus")
        measured_bus = robot.driver.bus == "measured" and log.has("v_bus")
        scale = _filled(t, log.columns["v_bus"]) / self.supply if measured_bus else 1.0
        self.has_w, self.w_extra = [], []
        for k, s in zip(self.sides, robot.sides):
            gain = model.get("speed_gain", k)
            w, th = self._get(f"w_{s}"), self._get(f"th_{s}")
            self.th.append(None if th is None else th / gain)
            self.has_w.append(w is not None)
            self.w_extra.append(np.zeros(self.n))
            if w is not None:
                self.w.append(_filled(t, w) / gain)
                self.w_noise.append(robot.noise(f"w_{s}"))
                self.w_rows.append(np.isfinite(w))
            elif th is not None:
                angle = _filled(t, th) / gain
                speed = np.gradient(angle, t)
                self.w.append(speed)
                noise = robot.noise(f"th_{s}") * np.sqrt(2.0) / (2.0 * float(np.median(self.dt)))
                self.w_noise.append(noise)
                # Where the speed bends, a difference of angles about the row is not its speed.
                bend = np.zeros(self.n)
                bend[1:-1] = np.diff(speed, 2)
                bend = np.maximum.reduce([np.abs(bend), np.abs(np.roll(bend, 1)), np.abs(np.roll(bend, -1))])
                self.w_extra[-1] = 0.5 * np.sqrt(np.maximum(bend**2 - (4.0 * noise) ** 2, 0.0))
                self.w_rows.append(np.isfinite(th))
            else:
                self.w.append(np.full(self.n, np.nan))
                self.w_noise.append(np.nan)
                self.w_rows.append(np.zeros(self.n, bool))
        for k, s in zip(self.sides, robot.sides):
            raw = np.clip(command[:, k], -self.supply, self.supply) * scale if self.voltage_mode else command[:, k]
            self.volts.append(raw)
            end, mean = self._held(raw, self.delay)
            self.v_end.append(end)
            self.v_mean.append(mean)
        # Currents of both sides before the drivers: a sagging supply couples them.
        guess = []
        for k, s in zip(self.sides, robot.sides):
            i = self._get(f"i_{s}")
            if i is not None:
                guess.append((_filled(t, i) - model.get("current_bias", k)) / model.get("current_gain", k))
            elif self.voltage_mode:
                guess.append((self.v_end[k] - model.get("back_emf", k) * gear * self.w[k]) / model.get("resistance", k))
            else:
                guess.append(np.zeros(self.n))
        self.draw = sum(guess[k] * self.v_end[k] for k in self.sides) / self.supply
        sag = model.get("source_resistance") * self.draw + model.get("decline") * (t - t[0])
        self.sag = sag
        for k, s in zip(self.sides, robot.sides):
            factor = 1.0 - sag / self.supply if not measured_bus else 1.0
            ke = model.get("back_emf", k) * gear
            end = self._driver(self.v_end[k], k) * factor
            mean = self._driver(self.v_mean[k], k) * (_mid(factor) if np.ndim(factor) else factor)
            limit = model.get("limit", k)
            end, mean = np.clip(end, -limit, limit), np.clip(mean, -limit, limit)
            if model.get("drop", k):
                end = end - model.get("drop", k) * np.tanh((end - ke * self.w[k]) / 0.05)
                mean = mean - model.get("drop", k) * np.tanh((mean - ke * _mid(self.w[k])) / 0.05)
            self.v_end[k], self.v_mean[k] = end, mean
            res = model.get("resistance", k) * np.ones(self.n)
            if model.get("heat_rise", k):
                res = res * (1.0 + model.get("heat_rise", k) * self._heat(guess[k], res[0], model.get("heat_tau", k)))
            tau = model.get("inductance", k) / res[0]
            settled = (end - ke * self.w[k]) / res
            measured = self._get(f"i_{s}")
            self.has_i.append(measured is not None)
            self.i_rows.append(np.zeros(self.n, bool) if measured is None else np.isfinite(measured))
            if measured is not None:
                # Rows without a sample follow the equation, shifted onto the samples about them.
                true = (measured - model.get("current_bias", k)) / model.get("current_gain", k)
                i = settled + _filled(t, true - settled)
            else:
                i = settled
            self.i.append(i)
            self.electric.append((res, tau, ke, settled))
        # Heading, for the slope and the pose.
        self.yaw = self._get("yaw") if self.body else None
        self.gyro = self._get("gyro_z") if self.body else None
        if self.body:
            r = [model.get("radius", k) for k in (0, 1)]
            rate = (r[1] * self.w[1] - r[0] * self.w[0]) / model.get("track")
            if self.yaw is not None:
                self.heading = _filled(t, self.yaw)
            else:
                start = 0.0
                turn = rate if self.gyro is None else ((_filled(t, self.gyro) - model.get("gyro_bias"))
                                                       / model.get("gyro_gain"))
                self.heading = start + _cum(_mid(turn), self.dt)
            self.mass = model.get("mass") + log.meta.payload_kg
            self.slope = log.meta.slope_rad + model.get("slope_extra")
            self.wheel_rate = rate
        half = max(1, round(0.015 / float(np.median(self.dt))))
        self.half = half
        self.acc = [np.gradient(_smooth(w, half), t) for w in self.w]
        speed = max(float(np.nanmax(np.abs(w), initial=0.0)) for w in self.w)
        self.sign = [np.tanh(_smooth(w, half) / max(0.02 * speed, 2.0 * noise, 1e-9))
                     for w, noise in zip(self.w, self.w_noise)]

    def _driver(self, volts: np.ndarray, k: int) -> np.ndarray:
        dead = self.model.get("deadzone", k)
        return (volts - np.sign(volts) * np.minimum(np.abs(volts), dead)) * self.model.get("voltage_gain", k)

    def _heat(self, current: np.ndarray, resistance: float, tau: float) -> np.ndarray:
        """First-order response to the winding's loss, (n,), in watts."""
        return _first_order(np.minimum(current**2 * resistance, 1e6), np.exp(-self.dt / tau))

    # ---- columns -------------------------------------------------------------------------------------------------
    def _put(self, cause: str, block: str, values: np.ndarray) -> None:
        column = self.columns.setdefault(cause, {})
        column[block] = column[block] + values if block in column else values

    def _volt_columns(self, cause: str, k: int, end: np.ndarray, mean: np.ndarray, late: bool = False) -> None:
        """A voltage beyond the modelled one, just before each row and in the mean of each interval.

        With a measured current only a `late` voltage reaches the torque: the samples miss what lies between them.
        """
        res = self.electric[k][0]
        s = self.robot.sides[k]
        if self.has_i[k]:
            self._put(cause, f"current_{s}", end / res)
            if late:
                self._torque_columns(cause, k, self.km[k] * (mean - end[1:]) / _mid(res))
        else:
            self._torque_columns(cause, k, self.km[k] * mean / _mid(res))

    def _torque_columns(self, cause: str, k: int, torque: np.ndarray) -> None:
        """A torque beyond the modelled one, (n - 1,) over each interval, at the wheel."""
        self._put(cause, f"torque_{self.robot.sides[k]}", self.cut(_cum(torque, self.dt)) / self.inertia[k])

    def _speed_columns(self, cause: str, k: int, error: np.ndarray, angle: bool) -> None:
        """A reported speed beyond the true one (n,); `angle`: the angle carries the same error."""
        s = self.robot.sides[k]
        res, _, ke, _ = self.electric[k]
        if self.has_i[k] and self.voltage_mode:
            self._put(cause, f"current_{s}", ke * error / res)
        self._put(cause, f"torque_{s}", self.cut(error))
        if not self.has_i[k] and self.voltage_mode:
            self._torque_columns(cause, k, self.km[k] * _mid(ke * error / res))
        if self.body:
            other = 1 - k
            self._put(cause, f"torque_{self.robot.sides[other]}", self.cut(error) * self.cross / self.inertia[other])
            if self.gyro is not None:
                lever = (1 if k else -1) * self.model.get("radius", k) / self.model.get("track")
                self._put(cause, "turn", -lever * error)
            if angle and self.way is not None:
                self._way_columns(cause, k, -error)
        if not angle and self.th[k] is not None:
            self._put(cause, f"speed_twice_{s}", -self.cut_twice(_cum(_mid(error), self.dt)))

    def _way_columns(self, cause: str, k: int, speed: np.ndarray) -> None:
        """A wheel's way over ground beyond the modelled one: `speed` (n,) rad/s at the wheel."""
        if self.way is None:
            return
        r = self.model.get("radius", k)
        lever = (1 if k else -1) * r / self.model.get("track")
        ds = 0.5 * r * _mid(speed) * self.dt
        dyaw = lever * _mid(speed) * self.dt
        self._put(cause, "way", self._way_stack(ds, dyaw))

    # ---- blocks --------------------------------------------------------------------------------------------------
    def _block(self, name: str, residual: np.ndarray, noise: np.ndarray | float, rows: np.ndarray) -> None:
        self.blocks[name] = (residual, np.broadcast_to(noise, residual.shape), rows)

    def _bus_block(self) -> None:
        self.cut = _Windows(self.t, WINDOW_S)
        self.cut_twice = _Windows(self.t, TWICE_WINDOW_S)
        model = self.model
        gear2 = model.get("gear_ratio") ** 2
        self.km = [model.get("torque_constant", k) * model.get("gear_ratio") for k in self.sides]
        axis = int(model.get("axis"))
        if self.body:
            r2 = model.get("radius", 0) * model.get("radius", 1)
            turn = model.get("yaw_inertia") * r2 / model.get("track") ** 2
            drive = 0.25 * self.mass * r2
            self.cross = drive - turn
            load = model.get("wheel_inertia") + drive + turn
        else:
            load = model.get("axis_inertia")
            if axis > 1:
                load += (model.get("axis_mass") + self.log.meta.payload_kg) * model.get("axis_arm") ** 2
            self.cross = 0.0
        self.inertia = [gear2 * model.get("rotor_inertia", k) + load for k in self.sides]
        self.w_mean = []
        for k in self.sides:
            braking = self.km[k] * self.electric[k][2] / float(self.electric[k][0][0]) if self.voltage_mode else 0.0
            braking += gear2 * model.get("viscous", k)
            self.w_mean.append(_relaxed(self.w[k], self.dt, max(self.inertia[k] / max(braking, 1e-12), 1e-4)))
        if self.bus is None or self.robot.driver.bus == "measured":
            return
        rows = np.isfinite(self.bus)
        self._block("bus", self.bus - (self.supply - self.sag), self.robot.noise("v_bus"), rows)
        self._put("driver:sag", "bus", -self.draw)
        self._put("driver:decline", "bus", -(self.t - self.t[0]))

    def _current_block(self, k: int) -> None:
        """Command and speed -> current, and the driver's and winding's signatures."""
        if not self.voltage_mode:
            return
        s = self.robot.sides[k]
        model = self.model
        res, tau, ke, settled = self.electric[k]
        i, w, t = self.i[k], self.w[k], self.t
        if self.has_i[k]:
            decay = np.concatenate([[0.0], np.exp(-self.dt / tau)])
            expected = settled + decay * (np.concatenate([[i[0]], i[:-1]]) - settled)
            noise_i = self.robot.noise(f"i_{s}") / abs(model.get("current_gain", k))
            # Speeds filled in between slow samples are less certain than the samples.
            noise = np.sqrt(noise_i**2 * (1 + decay**2) + (ke / res * np.hypot(self.w_noise[k], self.w_extra[k])) ** 2)
            rows = self.i_rows[k] & self.w_rows[k]
            rows[0] = False
            self._block(f"current_{s}", i - expected, noise, rows)

        volts = self.volts[k]
        end, mean = self._held(volts, self.delay)
        top = float(np.max(np.abs(volts), initial=0.0))
        self._volt_columns(f"driver:gain_{s}", k, end, mean)
        self._volt_columns(f"driver:deadzone_{s}", k, -np.sign(end), -np.sign(mean))
        self._volt_columns(f"driver:drop_{s}", k, -np.tanh(i / 0.02), -np.tanh(_mid(i) / 0.02))
        for part in (0.5, 0.7, 0.85):
            over = [-np.sign(v) * np.maximum(np.abs(v) - part * top, 0.0) for v in (end, mean)]
            self._volt_columns(f"driver:limit{part:g}_{s}", k, *over)
        ramp = (t - t[0]) / self.supply
        self._volt_columns("driver:decline", k, -ramp * end, -_mid(ramp) * mean)
        self._volt_columns("driver:sag", k, -self.draw / self.supply * end, -_mid(self.draw) / self.supply * mean)
        if self.bus is not None and self.robot.driver.bus == "nominal":
            bus = _smooth(_filled(t, self.bus) - (self.supply - self.sag), self.half) / self.supply
            self._volt_columns("driver:bus", k, bus * end, _mid(bus) * mean)
        if len(self.sides) == 2:
            other_end, other_mean = self._held(self.volts[1 - k], self.delay)
            self._volt_columns(f"driver:crosstalk_{s}", k, other_end, other_mean)
        step = [np.concatenate([[0.0], np.diff(v)]) for v in (end, mean)]
        direction = []
        for v, d in zip((end, mean), step):
            moved = np.flatnonzero(np.abs(d) > 1e-9)
            last = np.searchsorted(moved, np.arange(len(v)), side="right") - 1
            direction.append(np.where(last >= 0, np.sign(d[moved[np.maximum(last, 0)]]) if len(moved) else 0.0, 0.0))
        self._volt_columns(f"driver:hysteresis_{s}", k, -direction[0], -direction[1])
        for delay in DELAYS_S:
            late_end, late_mean = self._held(volts, self.delay + delay)
            self._volt_columns(f"timing:late{delay:g}", k, late_end - end, late_mean - mean, late=True)

        self._volt_columns(f"winding:resistance_{s}", k, -res * i, -_mid(res * i))
        for seconds in (8.0, 40.0):
            heat = self._heat(i, float(res[0]), seconds)
            self._volt_columns(f"winding:heating{seconds:g}_{s}", k, -res * i * heat, -_mid(res * i * heat))
        self._volt_columns(f"winding:constant_{s}", k, -ke * w, -ke * _mid(w))
        self._volt_columns(f"winding:saturation_{s}", k, -ke * w * np.abs(i), -ke * _mid(w * np.abs(i)))

    def _torque_block(self, k: int) -> None:
        """Current -> speed, and the mechanical signatures."""
        model, t, dt = self.model, self.t, self.dt
        s = self.robot.sides[k]
        gear = model.get("gear_ratio")
        res, tau, ke, _ = self.electric[k]
        w, i, sign = self.w[k], self.i[k], self.sign[k]
        fluid = gear**2 * model.get("viscous", k) + model.get("viscous_wheel", k)
        if self.robot.driver.mode == "torque":
            _, raw = self._held(self.volts[k], self.delay)
            drive = raw * model.get("torque_per_volt") * gear * model.get("voltage_gain", k)
            current_noise = 0.0
        elif self.voltage_mode:
            if tau < float(np.median(dt)) / 3:
                # Between rows the current follows voltage and speed; its measured end fixes the level.
                start = (self.v_mean[k] - ke * w[:-1]) / _mid(res)
                mean = (i[1:] + (self.v_mean[k] - self.v_end[k][1:]) / _mid(res)
                        + ke / _mid(res) * (w[1:] - self.w_mean[k]) + tau / dt * (i[:-1] - start))
            else:
                mean = _mid(i)
            drive = self.km[k] * mean
            current_noise = (self.robot.noise(f"i_{s}") / abs(model.get("current_gain", k)) if self.has_i[k]
                             else float(np.mean(ke / res)) * self.w_noise[k])
        elif self.has_i[k]:
            drive = self.km[k] * _mid(i)
            current_noise = self.robot.noise(f"i_{s}")
        else:
            return
        mid, sign_mid = self.w_mean[k], _mid(sign)
        pull = np.zeros(self.n)
        axis = int(model.get("axis"))
        load = None
        if self.body:
            r = model.get("radius", k)
            climb = np.sin(self.slope) * np.cos(self.heading - self.log.meta.uphill_yaw_rad)
            side_climb = np.sin(self.slope) * np.sin(self.heading - self.log.meta.uphill_yaw_rad)
            lever = (1 if k else -1) * r / model.get("track")
            pull = -0.5 * r * self.mass * GRAVITY_M_S2 * climb
            moment = self.mass * GRAVITY_M_S2 * (model.get("com_x") * side_climb + model.get("com_y") * climb)
            pull = pull + lever * moment
            drive_acc = 0.25 * self.mass * r * r * (self.acc[0] + self.acc[1])
            turn_acc = lever * model.get("yaw_inertia") * r * (self.acc[1] - self.acc[0]) / model.get("track")
            load = drive_acc + turn_acc - pull
            yaw_sign = np.tanh(_smooth(self.wheel_rate, self.half) / 0.03)
            yaw_sign_mid = _mid(yaw_sign)
        elif axis == 2:
            if self.th[k] is not None:
                angle = _filled(t, self.th[k])
            else:
                angle = _cum(_mid(w), dt) + model.get("axis_zero")
            arm = GRAVITY_M_S2 * model.get("axis_arm") * np.sin(angle - model.get("axis_zero"))
            pull = -(model.get("axis_mass") + self.log.meta.payload_kg) * arm
        torque = drive - fluid * mid + _mid(pull)
        # Effects that the model already holds.
        dry = model.get("coulomb", k) + model.get("stribeck", k) * np.exp(-(mid / model.get("stribeck_speed", k)) ** 2)
        if self.body:
            dry = dry + model.get("rolling") * self.mass * GRAVITY_M_S2 * 0.5 * r
            torque = torque - lever * model.get("scrub") * yaw_sign_mid
        dry = dry + model.get("load_share", k) * np.abs(drive - fluid * mid)
        # A wheel at rest is held by as much friction as it takes.
        rests = np.abs(_mid(_smooth(w, self.half))) < 3.0 * self.w_noise[k]
        torque = torque - np.where(rests, np.clip(torque, -dry, dry), dry * sign_mid)
        torque = torque - model.get("asymmetry", k) * np.abs(sign_mid) - model.get("asymmetry_viscous", k) * np.abs(mid)
        angle = _filled(t, self.th[k]) if self.th[k] is not None else _cum(mid, dt)
        if model.get("ripple", k):
            torque = torque + model.get("ripple", k) * np.sin(
                model.get("ripple_cycles", k) * _mid(angle) + model.get("ripple_phase", k))
        momentum = self.inertia[k] * w + (self.cross * self.w[1 - k] if self.body else 0.0)
        residual = self.cut(momentum - _cum(torque, dt)) / self.inertia[k]
        steps = float(np.median(dt))
        walk = (self.km[k] * current_noise * steps / self.inertia[k]) ** 2 * (WINDOW_S / steps) / 6.0
        if self.has_w[k]:
            white = self.w_noise[k] ** 2 * (1.0 + (self.cross / self.inertia[k]) ** 2)
        else:
            white = self.w_noise[k] ** 2 + self.w_extra[k] ** 2
        known = _near(t, self.w_rows[k]) & (_near(t, self.i_rows[k]) if self.has_i[k] else True)
        rows = self.w_rows[k] & np.isfinite(residual) & self.cut.whole(known)
        self._block(f"torque_{s}", residual, np.sqrt(white + walk), rows)

        def put(cause: str, values: np.ndarray) -> None:
            self._torque_columns(cause, k, values)

        put(f"drivetrain:coulomb_{s}", -sign_mid)
        put(f"drivetrain:steady_{s}", np.ones(self.n - 1))
        for fade in (0.3, 1.0):
            put(f"drivetrain:stribeck{fade:g}_{s}", -sign_mid * np.exp(-(mid / fade) ** 2))
        put(f"drivetrain:viscous_{s}", -max(gear**2 * model.get("viscous", k), 1e-9) * mid)
        put(f"drivetrain:quadratic_{s}", -mid * np.abs(mid))
        put(f"drivetrain:direction_{s}", -np.abs(sign_mid))
        put(f"drivetrain:direction_{s}b", -np.abs(mid))
        put(f"drivetrain:load_{s}", -np.abs(drive - fluid * mid) * sign_mid)
        put(f"drivetrain:growing_{s}", -sign_mid * _mid(t - t[0]))
        self._put(f"drivetrain:inertia_{s}", f"torque_{s}", -self.cut(gear**2 * model.get("rotor_inertia", k) * w)
                  / self.inertia[k])
        if load is not None:
            rate = np.gradient(_smooth(load, self.half), t)
            knock = np.gradient(np.tanh(_smooth(load, self.half) / 0.004), t)
            # Speed and angle are those of the gear's output; behind a spring or free play the wheel lags.
            for name, lead in (("spring", rate), ("play", knock)):
                cause = f"drivetrain:{name}_{s}"
                share = 1.0 - gear**2 * model.get("rotor_inertia", k) / self.inertia[k]
                self._put(cause, f"torque_{s}", share * self.cut(lead))
                if self.body and self.gyro is not None:
                    self._put(cause, "turn", -(1 if k else -1) * r / model.get("track") * lead)
        if self.th[k] is not None:
            for cycles in (1, 2, 3, 4, 6, 8, 12, 18):
                put(f"drivetrain:ripple{cycles}_{s}", np.sin(cycles * _mid(angle)))
                put(f"drivetrain:ripple{cycles}_{s}b", np.cos(cycles * _mid(angle)))
        if self.has_i[k] and self.voltage_mode:
            # What the current does between its samples hangs on the winding too.
            within = self.km[k] * ke / _mid(res) * (w[1:] - self.w_mean[k])
            put(f"winding:resistance_{s}", -within)
            put(f"winding:constant_{s}", within)
        if self.has_i[k]:
            self._put(f"sensing:current_gain_{s}", f"current_{s}", i)
            put(f"sensing:current_gain_{s}", -self.km[k] * _mid(i))
            self._put(f"sensing:current_bias_{s}", f"current_{s}", np.ones(self.n))
            put(f"sensing:current_bias_{s}", np.full(self.n - 1, -self.km[k]))
            put(f"winding:constant_{s}", self.km[k] * _mid(i))
            put(f"winding:saturation_{s}", -self.km[k] * _mid(i * np.abs(i)))
        elif self.voltage_mode:
            put(f"winding:constant_{s}", drive)
        if self.body:
            weight = GRAVITY_M_S2 * r * 0.5
            put("wheel_ground:rolling", -sign_mid * weight * self.mass)
            put("wheel_ground:scrub", -lever * yaw_sign_mid)
            put("chassis:mass", _mid(pull) / self.mass - 0.25 * r * r * _mid(self.acc[0] + self.acc[1]))
            uphill = self.heading - self.log.meta.uphill_yaw_rad
            put("chassis:slope", -weight * self.mass * _mid(np.cos(uphill)))
            put("chassis:slope_side", -weight * self.mass * _mid(np.sin(uphill)))
            put("chassis:com_x", lever * self.mass * (GRAVITY_M_S2 * _mid(side_climb)
                                                      - _mid(0.5 * r * (self.w[0] + self.w[1]) * self.wheel_rate)))
            put("chassis:com_x", 0.5 * r * self.mass * _mid(self.wheel_rate) ** 2)
            put("chassis:com_y", lever * self.mass * GRAVITY_M_S2 * _mid(climb))
            put("chassis:yaw_inertia", -_mid(turn_acc))
            put("chassis:drag", -0.5 * r * np.tanh(_mid(self.w[0] + self.w[1]) / 0.4))
            if self.log.has("x") and self.log.has("y"):
                # A tether pulls towards where the run began.
                x, y = (_filled(t, self.log.columns[c]) for c in ("x", "y"))
                away = (x - x[0]) * np.cos(self.heading) + (y - y[0]) * np.sin(self.heading)
                put("chassis:tether", -0.5 * r * _mid(away))
            put(f"wheel_ground:radius_{s}", -_mid(load))

    def _turn_block(self) -> None:
        """Wheel speeds -> yaw rate, and the signatures of the ground contact and of the gyro."""
        model = self.model
        r = [model.get("radius", k) for k in (0, 1)]
        track = model.get("track")
        self.way = None
        if self.gyro is not None and np.isfinite(self.wheel_rate).all():
            noise_gyro = self.robot.noise("gyro_z") / abs(model.get("gyro_gain"))
            true = (self.gyro - model.get("gyro_bias")) / model.get("gyro_gain")
            noise = np.hypot(noise_gyro, np.hypot(r[0] * np.hypot(self.w_noise[0], self.w_extra[0]),
                                                r[1] * np.hypot(self.w_noise[1], self.w_extra[1])) / track)
            rows = np.isfinite(true) & self.w_rows[0] & self.w_rows[1]
            self._block("turn", true - self.wheel_rate, noise, rows)
            self._put("sensing:gyro_gain", "turn", self.wheel_rate)
            self._put("sensing:gyro_bias", "turn", np.ones(self.n))
            self._put("chassis:track", "turn", -self.wheel_rate)
            for k, s in enumerate(self.robot.sides):
                lever = (1 if k else -1) * r[k] / track
                self._put(f"wheel_ground:radius_{s}", "turn", lever * self.w[k])
        self._pose_windows()
        for k in (0, 1):
            s = self.robot.sides[k]
            w = self.w[k]
            if not np.isfinite(w).all():
                continue
            self._speed_columns(f"sensing:speed_gain_{s}", k, w, True)
            self._speed_columns(f"sensing:speed_filter_{s}", k, -self.acc[k], False)
            if self.th[k] is not None and self.has_w[k]:
                slow = _smooth(np.gradient(_filled(self.t, self.th[k]), self.t), 2)
                self._speed_columns(f"sensing:speed_fault_{s}", k, _smooth(w, 2) - slow, False)

    def _pose_windows(self) -> None:
        log, t = self.log, self.t
        if self.yaw is None or any(not np.isfinite(w).all() for w in self.w):
            return
        full = self._get("x") is not None and self._get("y") is not None
        good = np.isfinite(self.yaw)
        if full:
            good &= np.isfinite(log.columns["x"]) & np.isfinite(log.columns["y"])
        rows = np.flatnonzero(good)
        if len(rows) < 3:
            return
        picked, last = [rows[0]], t[rows[0]]
        for row in rows[1:]:
            if t[row] - last >= POSE_WINDOW_S - 1e-6:
                picked.append(row)
                last = t[row]
        rows = np.array(picked)
        if len(rows) < 3:
            return
        # The last row of a window belongs to the next one; intervals take the heading of the window they lie in.
        start = np.maximum(np.searchsorted(rows, np.arange(self.n - 1), side="right") - 1, 0)
        mid = _mid(self.heading) - self.heading[rows][start]
        self.way = (rows, np.cos(mid), np.sin(mid), full)

    def _way_stack(self, ds: np.ndarray, dyaw: np.ndarray) -> np.ndarray:
        """Yaw, forward and sideways moves of each window, one after the other."""
        rows, c, s, full = self.way
        parts = [np.diff(np.concatenate([[0.0], np.cumsum(dyaw)])[rows])]
        if full:
            parts += [np.diff(np.concatenate([[0.0], np.cumsum(ds * f)])[rows]) for f in (c, s)]
        return np.concatenate(parts)

    def _way_block(self) -> None:
        """Wheel angles -> how the pose moves."""
        if self.way is None:
            return
        model, t = self.model, self.t
        rows, _, _, full = self.way
        r = [model.get("radius", k) for k in (0, 1)]
        track = model.get("track")
        turned, angle_noise = [], []
        for k in (0, 1):
            s = self.robot.sides[k]
            if self.th[k] is not None:
                turned.append(np.diff(_filled(t, self.th[k])))
                angle_noise.append(self.robot.noise(f"th_{s}") * np.sqrt(2.0))
            else:
                turned.append(_mid(self.w[k]) * self.dt)
                angle_noise.append(self.w_noise[k] * np.sqrt(POSE_WINDOW_S * float(np.median(self.dt))))
        ds = 0.5 * (r[0] * turned[0] + r[1] * turned[1])
        dyaw = (r[1] * turned[1] - r[0] * turned[0]) / track
        x, y = (self.log.columns[c] if full else np.zeros(self.n) for c in ("x", "y"))
        heading = self.yaw[rows[:-1]]
        dx, dy = np.diff(x[rows]), np.diff(y[rows])
        c, s = np.cos(heading), np.sin(heading)
        measured = [np.diff(self.yaw[rows])]
        way_noise = np.hypot(r[0] * angle_noise[0], r[1] * angle_noise[1])
        noise = [np.full(len(rows) - 1, np.hypot(self.robot.noise("yaw") * np.sqrt(2.0), way_noise / track))]
        if full:
            measured += [c * dx + s * dy, c * dy - s * dx]
            far = np.hypot(dx, dy)
            flat = np.hypot(self.robot.noise("x") * np.sqrt(2.0), 0.5 * way_noise)
            noise += [np.full(len(dx), flat), np.hypot(flat, self.robot.noise("yaw") * far)]
        residual = np.concatenate(measured) - self._way_stack(ds, dyaw)
        where = np.tile(rows[:-1], 3 if full else 1)
        self._block("way", residual, np.concatenate(noise), where)
        zero = np.zeros(self.n - 1)
        self._put("chassis:track", "way", self._way_stack(zero, -dyaw))
        forward = 0.5 * (r[0] * self.w[0] + r[1] * self.w[1])
        late = self._way_stack(np.diff(forward), np.diff(self.wheel_rate))
        self._put("timing:pose", "way", late)
        for k in (0, 1):
            s = self.robot.sides[k]
            self._way_columns(f"wheel_ground:radius_{s}", k, self.w[k])
            force = self.mass * 0.25 * (r[0] * self.acc[0] + r[1] * self.acc[1]) * 2
            climb = np.sin(self.slope) * np.cos(self.heading - self.log.meta.uphill_yaw_rad)
            force = (force + self.mass * GRAVITY_M_S2 * climb) * 0.5
            force = force + (1 if k else -1) * model.get("yaw_inertia") / track**2 * (r[1] * self.acc[1]
                                                                                      - r[0] * self.acc[0])
            lost = -self.w[k] * force
            self._way_columns(f"wheel_ground:slip_{s}", k, lost)
            if self.gyro is not None:
                self._put(f"wheel_ground:slip_{s}", "turn", (1 if k else -1) * r[k] / track * lost)

    def _speed_twice_block(self, k: int) -> None:
        """Angle against the integral of the speed."""
        s = self.robot.sides[k]
        if self.th[k] is None or not self.has_w[k]:
            return
        th = self.th[k]
        rows = np.isfinite(th)
        residual = self.cut_twice(_filled(self.t, th) - _cum(self.w_mean[k], self.dt))
        rows &= self.cut_twice.whole(_near(self.t, self.w_rows[k]))
        step = float(np.median(self.dt))
        gap = float(np.median(np.diff(self.t[self.w_rows[k]]))) if self.w_rows[k].sum() > 2 else step
        walk = self.w_noise[k] ** 2 * gap * TWICE_WINDOW_S / 6.0
        self._block(f"speed_twice_{s}", residual, np.sqrt(self.robot.noise(f"th_{s}") ** 2 + walk), rows)

    def _yaw_twice_block(self) -> None:
        """Yaw against the integral of the gyro."""
        if self.gyro is None or self.yaw is None:
            return
        model = self.model
        rows = np.isfinite(self.yaw)
        true = (_filled(self.t, self.gyro) - model.get("gyro_bias")) / model.get("gyro_gain")
        turned = _cum(_mid(true), self.dt)
        late = model.get("measurement_delay")
        if late:
            turned = np.interp(self.t + late, self.t, turned)
        rows &= self.cut_twice.whole(_near(self.t, np.isfinite(self.gyro)))
        step = float(np.median(np.diff(self.t[np.isfinite(self.gyro)])))
        walk = self.robot.noise("gyro_z") ** 2 * step * TWICE_WINDOW_S / 6.0
        self._block("yaw_twice", self.cut_twice(_filled(self.t, self.yaw) - turned),
                    np.sqrt(self.robot.noise("yaw") ** 2 + walk), rows)
        self._put("sensing:gyro_gain", "yaw_twice", -self.cut_twice(turned))
        self._put("sensing:gyro_bias", "yaw_twice", -self.cut_twice(self.t))
        self._put("timing:pose", "yaw_twice", self.cut_twice(_filled(self.t, self.gyro)))


def _regimes(run: _Run) -> dict[str, np.ndarray]:
    """Regime -> which rows of the run are in it."""
    t = run.t
    speed = np.nanmean([np.abs(_smooth(w, run.half)) for w in run.w], axis=0)
    top = float(np.nanmax(speed, initial=0.0))
    forward = np.nanmean([_smooth(w, run.half) for w in run.w], axis=0)
    result = {"slow": speed < 0.3 * top, "fast": speed >= 0.3 * top}
    turned = np.zeros(len(t), bool)
    for w in run.w:
        sign = np.sign(np.where(np.abs(w) > 5 * 0.02 * max(top, 1e-9), w, 0.0))
        kept = np.flatnonzero(sign)
        for a, b in itertools.pairwise(kept):
            if sign[a] != sign[b]:
                turned |= (t > t[a] - 0.1) & (t < t[b] + 0.1)
    result["reversal"] = turned
    gain = np.gradient(speed, t) if len(t) > 2 else np.zeros(len(t))
    result["speeding up"], result["slowing down"] = gain > 0.3 * top, gain < -0.3 * top
    result["forwards"], result["backwards"] = forward > 0.05 * top, forward < -0.05 * top
    if run.body:
        climb = np.sin(run.slope) * np.cos(run.heading - run.log.meta.uphill_yaw_rad) * np.sign(forward)
        result["uphill"], result["downhill"] = climb > 0.02, climb < -0.02
        result["level"] = np.abs(climb) <= 0.02
        turn = _smooth(run.wheel_rate, run.half)
        fast = float(np.nanmax(np.abs(turn), initial=0.0))
        result["straight"] = np.abs(turn) < max(0.1 * fast, 0.05)
        result["turning left"], result["turning right"] = turn >= max(0.1 * fast, 0.05), turn <= -max(0.1 * fast, 0.05)
    result["with payload"] = np.full(len(t), run.log.meta.payload_kg > 0)
    result["without payload"] = ~result["with payload"]
    half = 0.5 * (t[0] + t[-1])
    result["first half"], result["second half"] = t < half, t >= half
    return result


def _lost(case: Case) -> tuple[str, ...]:
    robot = case.robot

    def there(*names: str) -> bool:
        return any(all(log.has(n) and robot.noise(n) is not None for n in names) for log in case.runs)

    lost = []
    sides = robot.sides
    if robot.driver.mode != "torque" and not all(there(f"i_{s}") for s in sides):
        lost.append("without current, driver and winding cannot be told from the drivetrain")
    if robot.driver.bus == "nominal" and robot.driver.mode == "voltage" and not there("v_bus"):
        lost.append("without v_bus, the supply cannot be told from driver and winding")
    if any(not there(f"w_{s}", f"th_{s}") for s in sides):
        lost.append("with only one of speed and angle, errors of the speed sensor show in no comparison of the two")
    if robot.chassis is not None:
        if not there("gyro_z") and not there("yaw"):
            lost.append("without gyro and yaw, nothing between the wheels and the body's motion can be seen")
        elif not (there("gyro_z") and there("yaw")):
            lost.append("with only one of gyro and yaw, the gyro cannot be told from the ground contact")
        if not there("x", "y"):
            lost.append("without x and y, wheel radius and track width cannot be told apart")
    return tuple(lost)


def _group(cause: str) -> str:
    subsystem, name = cause.split(":")
    if name.startswith("late"):
        return "timing:late"
    for s in ("_lb", "_rb", "_l", "_r"):
        name = name.removesuffix(s)
    return f"{subsystem}:{name}"


def localise(case: Case, model: Model) -> Localisation:
    """Replay each block of a case from measured signals and say where the gap lies.

    Parameters
    ----------
    case : the runs. model : the robot as far as it is known: nominal, with nuisances refitted, or with effects.

    Returns
    -------
    blocks in the order of the signal chain, scores in units of noise, shares of the subsystems.
    """
    runs = [_Run(log, case.robot, model) for log in case.runs]
    sums = _Sums(runs)
    located, chosen, lag = _share(sums)
    excess = {b: max(sums.energy[b] - sums.count[b], 0.0) for b in sums.blocks}
    whole = sum(excess.values())
    found = tuple(
        Block(name=b, subsystem=BLOCKS[b], title=TITLES[b], n=sums.count[b],
              score=float(np.sqrt(sums.energy[b] / sums.count[b])) if sums.count[b] else float("nan"),
              regimes={r: float(np.sqrt(e / n)) for r, (e, n) in sums.regimes[b].items()},
              share=excess[b] / whole if whole > 0 else 0.0)
        for b in sums.blocks)
    return Localisation(found, located, tuple(chosen), _lost(case), lag)


class _Sums:
    """Normal equations of all blocks and runs: `gram[block]`, `cross[block]`, `energy[block]`, `count[block]`."""

    def __init__(self, runs: list[_Run]):
        self.names = sorted({c for run in runs for c in run.columns})
        self.blocks = [b for b in BLOCKS if any(b in run.blocks for run in runs)]
        index = {name: j for j, name in enumerate(self.names)}
        size = len(self.names)
        self.gram = {b: np.zeros((size, size)) for b in self.blocks}
        self.cross = {b: np.zeros(size) for b in self.blocks}
        self.energy = dict.fromkeys(self.blocks, 0.0)
        self.count = dict.fromkeys(self.blocks, 0)
        self.regimes: dict[str, dict[str, list[float]]] = {b: {} for b in self.blocks}
        self.both = [0.0, 0.0, 0.0]
        self.against = [0.0, 0.0]
        for run in runs:
            which = _regimes(run)
            for b in self.blocks:
                if b in run.blocks:
                    self._add(run, b, index, which)
            self._sides(run)

    def _add(self, run: _Run, b: str, index: dict[str, int], which: dict[str, np.ndarray]) -> None:
        residual, noise, rows = run.blocks[b]
        take = np.arange(len(residual)) if b == "way" else np.flatnonzero(rows)
        at = rows[take] if b == "way" else take
        z = residual[take] / noise[take]
        keep = np.isfinite(z)
        # A block that has left all bounds says no more than that.
        take, at, z = take[keep], at[keep], np.clip(z[keep], -1e4, 1e4)
        used = [c for c in run.columns if b in run.columns[c]]
        a = np.empty((len(z), len(used)))
        for j, c in enumerate(used):
            a[:, j] = run.columns[c][b][take] / noise[take]
        a[~np.isfinite(a)] = 0.0
        place = [index[c] for c in used]
        self.gram[b][np.ix_(place, place)] += a.T @ a
        self.cross[b][place] += a.T @ z
        self.energy[b] += float(z @ z)
        self.count[b] += len(z)
        for regime, mask in which.items():
            inside = mask[at]
            if inside.sum() >= 10:
                entry = self.regimes[b].setdefault(regime, [0.0, 0])
                entry[0] += float(z[inside] @ z[inside])
                entry[1] += int(inside.sum())

    def _sides(self, run: _Run) -> None:
        """Do both sides' torques miss together, and do they miss against the motion?"""
        torque = {}
        for k in run.sides:
            b = f"torque_{run.robot.sides[k]}"
            if b not in run.blocks:
                return
            residual, noise, rows = run.blocks[b]
            z = np.where(rows, np.clip(residual / noise, -1e4, 1e4), 0.0)
            push = run.columns[f"drivetrain:steady_{run.robot.sides[k]}"][b] / noise
            push = np.where(rows, push, 0.0)
            starts = run.cut.starts
            norm = np.add.reduceat(push * push, starts)
            estimate = np.add.reduceat(push * z, starts) / np.maximum(norm, 1e-12)
            estimate *= np.sqrt(norm)
            torque[k] = estimate
            motion = np.sign(np.add.reduceat(_smooth(run.w[k], run.half), starts))
            big = np.abs(estimate) > 3.0
            self.against[0] -= float(np.sum((estimate * np.abs(estimate) * motion)[big]))
            self.against[1] += float(np.sum(estimate[big] ** 2))
        if len(torque) == 2:
            self.both[0] += float(torque[0] @ torque[1])
            self.both[1] += float(torque[0] @ torque[0])
            self.both[2] += float(torque[1] @ torque[1])

    @property
    def together(self) -> float:
        """Correlation of both sides' missing torques, -1 to 1."""
        return self.both[0] / np.sqrt(max(self.both[1] * self.both[2], 1e-12))

    @property
    def opposing(self) -> float:
        """-1 to 1: 1 where all missing torque acts against the motion."""
        return self.against[0] / max(self.against[1], 1e-12)


def _share(sums: _Sums) -> tuple[dict[str, float], list[tuple[str, str, float]], float]:
    """Explain the residual energy by signatures, one at a time; the rest stays with its block."""
    names, blocks, gram, cross, energy, count = (sums.names, sums.blocks, sums.gram, sums.cross, sums.energy,
                                                 sums.count)
    excess = {b: max(energy[b] - count[b], 0.0) for b in blocks}
    total_gram = sum(gram.values()) if blocks else np.zeros((len(names), len(names)))
    total_cross = sum(cross.values()) if blocks else np.zeros(len(names))
    groups: dict[str, list[int]] = {}
    for j, name in enumerate(names):
        if total_gram[j, j] > 0:
            groups.setdefault(_group(name), []).append(j)
    always = [j for name in NUISANCES for j in groups.get(name, [])]
    nuisance = set(always)

    def fit(columns: list[int], loose: set[int]) -> tuple[float, np.ndarray]:
        """Energy that columns explain, nuisances kept within their prior and within `NAMED`."""
        fixed = np.zeros(len(columns))
        held = np.zeros(len(columns), bool)
        tight = np.array([j in nuisance and j not in loose for j in columns])
        g = total_gram[np.ix_(columns, columns)]
        c = total_cross[columns]
        for _ in range(3):
            free = ~held
            p = np.where(tight, 1.0 / PRIOR**2, 0.0)[free]
            gf = g[np.ix_(free, free)]
            d = np.sqrt(np.diag(gf) + p)
            normal = gf / np.outer(d, d)
            normal[np.diag_indices_from(normal)] += p / d**2 + 1e-9
            theta = fixed.copy()
            theta[free] = np.linalg.solve(normal, (c[free] - g[np.ix_(free, held)] @ fixed[held]) / d) / d
            over = tight & free & (np.abs(theta) > NAMED)
            if not over.any():
                break
            fixed[over] = np.sign(theta[over]) * NAMED
            held |= over
        return float(2.0 * theta @ c - theta @ g @ theta), theta

    # The column of a speed sensor's fault holds that sensor's noise: it counts only where the two readings disagree.
    twice = any(excess.get(f"speed_twice_{s}", 0.0) > 0.2 * count.get(f"speed_twice_{s}", 0) for s in "lr")
    located = dict.fromkeys(SUBSYSTEMS, 0.0)
    chosen: list[tuple[str, str, float]] = []
    picked: list[int] = list(always)
    loose: set[int] = set()
    explained, theta = fit(picked, loose) if picked else (0.0, np.zeros(0))
    # Noise is known to a few per cent only; what no column at all can lower is not excess.
    floor = sum(min(count[b], energy[b]) for b in blocks)
    left = sum(energy.values()) - explained - floor
    whole = left
    # So small an excess may be the colour of the noise, which some columns share.
    if whole < FAINT * floor:
        return located, chosen, 0.0
    for _ in range(6):
        best = None
        for group, members in groups.items():
            if "steady" in group or (group == "sensing:speed_fault" and not twice) or any(group == g for g, _, _ in chosen):
                continue
            extra = [j for j in members if j not in picked]
            value, _ = fit(picked + extra, loose | set(members))
            gain = value - explained - 2.0 * len(members)
            if best is None or gain > best[0]:
                best = (gain, group, members, extra)
        if best is None or best[0] < max(BELIEVED * left, BELIEVED_OF_ALL * whole, 30.0):
            break
        gain, group, members, extra = best
        picked += extra
        loose |= set(members)
        explained, theta = fit(picked, loose)
        chosen.append((group, group.split(":")[0], min(gain / max(whole, gain), 1.0)))
        located[group.split(":")[0]] += gain
        left -= gain
    if left > 0.02 * whole:
        remaining = {}
        for b in blocks:
            g = gram[b][np.ix_(picked, picked)]
            remaining[b] = max(energy[b] - 2.0 * theta @ cross[b][picked] + theta @ g @ theta - count[b], 0.0)
        scale = sum(remaining.values())
        for b, value in remaining.items():
            for subsystem, part in _owner(b, sums, excess).items():
                located[subsystem] += part * left * value / scale if scale > 0 else 0.0
    total = sum(located.values())
    located = {s: float(v / total) if total > 0 else 0.0 for s, v in located.items()}
    lag = 0.0
    if any(group == "timing:late" for group, _, _ in chosen):
        late = groups["timing:late"]
        others = [j for j in picked if j not in late]
        lag = max(late, key=lambda j: fit([*others, j], loose)[0])
        lag = float(names[lag].split("late")[1])
    return located, chosen, lag


def _owner(block: str, sums: _Sums, excess: dict[str, float]) -> dict[str, float]:
    """Subsystems that the unexplained rest of a block speaks of."""
    if block.startswith("torque") and len(sums.blocks) > 1 and sums.both[1] > 0:
        # What pushes the body is felt by both wheels at once, and not always against their motion.
        body = min(abs(sums.together), 1.0) ** 2 * (1.0 - max(sums.opposing, 0.0) ** 2)
        return {"chassis": body, "drivetrain": 1.0 - body}
    if block == "turn" and "way" in excess and excess["turn"] > 0:
        # A wheel that slips takes the pose with it; one that shakes behind its gear does not.
        slips = excess["way"] / max(sums.count["way"], 1) > 0.05 * excess["turn"] / sums.count["turn"]
        return {"wheel_ground": 1.0} if slips else {"drivetrain": 1.0}
    return {BLOCKS[block]: 1.0}
