"""What every block of one run works with: its signals on the rows of the log, and how a cause shows in the blocks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis import gap
from rtds_host.diagnosis.localise.series import Windows, cumulated, filled, first_order, middles, relaxed, smooth
from rtds_host.diagnosis.problem import PIECE_S
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.scales import scales_of
from rtds_host.plant.compiled import loop
from rtds_host.plant.driver import decay_adds, duty
from rtds_host.plant.elementary import exponential

# Blocks start again from what is measured once a discrepancy has come and gone: the longer, the better small torques
# show, and the farther a wrong start leads.
WINDOW_S = PIECE_S
# Numerical: over how many volts of a bridge, and over what share of the largest speed or how many noises, a sign turns
# over.
SIGN_V, SIGN_SHARE, SIGN_NOISES = 0.05, 0.02, 2.0
# Numerical: to either side of a row over which a speed is averaged.
SMOOTH_S = 0.015


@loop
def duties(volts, supply, curve, deadzone, gain):
    """`rtds_host.plant.driver.duty` of voltages (n,), V."""
    out = np.empty_like(volts)
    for k in range(len(volts)):
        out[k] = duty(volts[k], supply, curve, deadzone, gain)
    return out


@loop
def decayed(curved, plain, emf, supply, share, periods):
    """Voltages (n,) V with what `rtds_host.plant.driver.decay_adds`; curved, plain, emf : (n,) V."""
    out = np.empty_like(curved)
    for k in range(len(curved)):
        out[k] = curved[k] + decay_adds(curved[k], plain[k], emf[k], supply, share, periods, exponential)
    return out


class Way(NamedTuple):
    """Windows of a measured pose: their rows; cosine and sine (n - 1,) of the heading gained in the window, of each
    interval; whether the position is measured with the heading.
    """

    rows: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    placed: bool


class Signals:
    """Signals of one run, brought to its rows, with each block's residual and, where asked for, the signatures'
    columns.
    """

    def __init__(self, log: RunLog, robot: Robot, model: Model, signatures: bool = True):
        self.log, self.robot, self.model, self.signatures = log, robot, model, signatures
        self.scales = scales_of(robot, [log])
        self.t = log.t
        self.dt = np.diff(log.t)
        self.n = len(log.t)
        self.sides = range(len(robot.sides))
        self.body = robot.chassis is not None
        self.blocks: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}  # residual, noise, rows
        self.columns: dict[str, dict[str, np.ndarray]] = {}
        # By side. Speeds, their noise, what else they may be off by, and the rows that have a sample.
        self.w: list[np.ndarray] = []
        self.w_noise: list[float] = []
        self.w_extra: list[np.ndarray] = []
        self.w_rows: list[np.ndarray] = []
        self.has_w: list[bool] = []
        self.th: list[np.ndarray | None] = []
        # Currents and the rows that have a sample; voltages just before each row and in the mean of each interval.
        self.i: list[np.ndarray] = []
        self.has_i: list[bool] = []
        self.i_rows: list[np.ndarray] = []
        self.volts: list[np.ndarray] = []
        self.v_end: list[np.ndarray] = []
        self.v_mean: list[np.ndarray] = []
        # Resistance (n,), electrical time constant, back EMF at the wheel, and the current of a steady voltage (n,).
        self.electric: list[tuple[np.ndarray, float, float, np.ndarray]] = []
        self.supply = model.get("supply")
        self.voltage_mode = robot.driver.mode == "voltage"
        self.delay = model.get("command_delay") - model.get("command_early") + model.get("measurement_delay")
        self.bus = self.get("v_bus")
        self.yaw = self.get("yaw") if self.body else None
        self.gyro = self.get("gyro_z") if self.body else None
        # Of a robot on wheels: heading and yaw rate by the wheels, mass with payload, slope; the windows of its pose.
        self.heading, self.wheel_rate = np.zeros(self.n), np.zeros(self.n)
        self.mass = self.slope = 0.0
        self.way: Way | None = None
        self._speeds()
        self._drive()
        if self.body:
            self._heading()
        self._changes()
        self._loads()
        self._pose_windows()

    # ---- signals -------------------------------------------------------------------------------------------------
    def get(self, name: str) -> np.ndarray | None:
        return self.log.columns[name] if self.log.has(name) and self.robot.noise(name) is not None else None

    def held(self, command: np.ndarray, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """A held command that acts `delay` late: its value just before each row (n,), its mean over each interval."""
        t = self.t
        if delay <= 0:
            return np.concatenate([[0.0], command[:-1]]), command[:-1]
        index = np.searchsorted(t, t - delay, side="left") - 1
        before = np.where(index >= 0, command[np.maximum(index, 0)], 0.0)
        total = cumulated(command[:-1], self.dt)
        return before, np.diff(np.interp(t - delay, t, total, left=0.0)) / self.dt

    def _speeds(self) -> None:
        """Speeds and angles at the gear's output, with the noise of a sample and the rows that have one."""
        robot, model, t = self.robot, self.model, self.t
        for k, s in zip(self.sides, robot.sides):
            gain = model.get("speed_gain", k)
            w, th = self.get(f"w_{s}"), self.get(f"th_{s}")
            self.th.append(None if th is None else th / gain)
            self.has_w.append(w is not None)
            self.w_extra.append(np.zeros(self.n))
            if w is not None:
                self.w.append(filled(t, w) / gain)
                self.w_noise.append(robot.known_noise(f"w_{s}"))
                self.w_rows.append(np.isfinite(w))
            elif th is not None:
                angle = filled(t, th) / gain
                speed = np.gradient(angle, t)
                self.w.append(speed)
                noise = robot.known_noise(f"th_{s}") * np.sqrt(2.0) / (2.0 * float(np.median(self.dt)))
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

    def _drive(self) -> None:
        """Commands, voltages behind the driver, currents."""
        log, robot, model, t = self.log, self.robot, self.model, self.t
        command = log.commands(robot.driver.mode)
        measured_bus = robot.driver.bus == "measured" and log.has("v_bus")
        scale = filled(t, log.columns["v_bus"]) / self.supply if measured_bus else 1.0
        for k in self.sides:
            raw = np.clip(command[:, k], -self.supply, self.supply) if self.voltage_mode else command[:, k]
            raw = raw * scale if robot.driver.mode != "speed" else raw
            self.volts.append(raw)
            end, mean = self.held(raw, self.delay)
            self.v_end.append(end)
            self.v_mean.append(mean)
        # Currents of both sides before the drivers: a sagging supply couples them.
        guess = [self._guess(k) for k in self.sides]
        # A side of which nothing is measured draws an unknown current, taken for none.
        self.draw = sum(np.nan_to_num(guess[k], nan=0.0) * self.v_end[k] for k in self.sides) / self.supply
        sag = model.get("source_resistance") * self.draw + model.get("decline") * (t - t[0] + log.since_s)
        self.sag = sag
        for k in self.sides:
            self._winding(k, guess[k], None if measured_bus else 1.0 - sag / self.supply)

    def _guess(self, k: int) -> np.ndarray:
        """The current (n,) A that a side has or, where it is not measured, would have at a steady voltage."""
        model = self.model
        i = self.get(f"i_{self.robot.sides[k]}")
        if i is not None:
            return (filled(self.t, i) - model.get("current_bias", k)) / model.get("current_gain", k)
        if self.voltage_mode:
            ke = model.get("back_emf", k) * model.get("gear_ratio")
            return (self.v_end[k] - ke * self.w[k]) / model.get("resistance", k)
        return np.zeros(self.n)

    def _winding(self, k: int, guess: np.ndarray, factor: np.ndarray | None) -> None:
        """Voltage behind the driver, times `factor` (n,) where the bus sags, and the current that follows from it."""
        model, t = self.model, self.t
        ke = model.get("back_emf", k) * model.get("gear_ratio")
        emf = ke * self.w[k]
        end, mean = self.driver(self.v_end[k], emf, k), self.driver(self.v_mean[k], middles(emf), k)
        if factor is not None:
            end, mean = end * factor, mean * middles(factor)
        limit = model.get("limit", k)
        end, mean = np.clip(end, -limit, limit), np.clip(mean, -limit, limit)
        if model.get("drop", k):
            width = SIGN_V + model.get("drop_knee", k) * model.get("resistance", k)
            end = end - model.get("drop", k) * np.tanh((end - ke * self.w[k]) / width)
            mean = mean - model.get("drop", k) * np.tanh((mean - ke * middles(self.w[k])) / width)
        self.v_end[k], self.v_mean[k] = end, mean
        res = model.get("resistance", k) * np.ones(self.n)
        if model.get("heat_rise", k):
            res = res * (1.0 + model.get("heat_rise", k) * self.heat(guess, res[0], model.get("heat_tau", k)))
        tau = model.get("inductance", k) / res[0]
        settled = (end - ke * self.w[k]) / res
        measured = self.get(f"i_{self.robot.sides[k]}")
        self.has_i.append(measured is not None)
        self.i_rows.append(np.zeros(self.n, bool) if measured is None else np.isfinite(measured))
        if measured is not None:
            # Rows without a sample follow the equation, shifted onto the samples about them.
            true = (measured - model.get("current_bias", k)) / model.get("current_gain", k)
            i = settled + (filled(t, true - settled) if np.isfinite(true - settled).any() else 0.0)
        else:
            i = settled
        self.i.append(i)
        self.electric.append((res, tau, ke, settled))

    def _heading(self) -> None:
        """Heading of a robot on wheels, for the slope and the pose."""
        model, log, t = self.model, self.log, self.t
        r = [model.get("radius", k) for k in (0, 1)]
        rate = (r[1] * self.w[1] - r[0] * self.w[0]) / model.get("track")
        if self.yaw is not None:
            self.heading = filled(t, self.yaw)
        else:
            turn = (
                rate if self.gyro is None else (filled(t, self.gyro) - model.get("gyro_bias")) / model.get("gyro_gain")
            )
            self.heading = 0.0 + cumulated(middles(turn), self.dt)
        self.mass = model.get("mass") + log.meta.payload_kg
        self.slope = log.meta.slope_rad + model.get("slope_extra")
        self.wheel_rate = rate

    def _changes(self) -> None:
        """Accelerations, and which way the wheels turn."""
        half = max(1, round(SMOOTH_S / float(np.median(self.dt))))
        self.half = half
        self.acc = [np.gradient(smooth(w, half), self.t) for w in self.w]
        speed = max(float(np.nanmax(np.abs(w), initial=0.0)) for w in self.w)
        self.sign = [
            np.tanh(smooth(w, half) / max(SIGN_SHARE * speed, SIGN_NOISES * noise, 1e-9))
            for w, noise in zip(self.w, self.w_noise)
        ]

    def _loads(self) -> None:
        """Inertia that each motor moves, and the speeds' means between the rows."""
        self.cut = Windows(self.t, WINDOW_S)
        self.cut_twice = Windows(self.t, gap.WINDOW_S)
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
            self.w_mean.append(relaxed(self.w[k], self.dt, max(self.inertia[k] / max(braking, 1e-12), 1e-4)))

    def _pose_windows(self) -> None:
        log, t = self.log, self.t
        if self.yaw is None or any(not np.isfinite(w).all() for w in self.w):
            return
        full = self.get("x") is not None and self.get("y") is not None
        good = np.isfinite(self.yaw)
        if full:
            good &= np.isfinite(log.columns["x"]) & np.isfinite(log.columns["y"])
        rows = np.flatnonzero(good)
        if len(rows) < 3:
            return
        picked, last = [rows[0]], t[rows[0]]
        for row in rows[1:]:
            if t[row] - last >= gap.WINDOW_S - 1e-6:
                picked.append(row)
                last = t[row]
        rows = np.array(picked)
        if len(rows) < 3:
            return
        # The last row of a window belongs to the next one; intervals take the heading of the window they lie in.
        start = np.maximum(np.searchsorted(rows, np.arange(self.n - 1), side="right") - 1, 0)
        mid = middles(self.heading) - self.heading[rows][start]
        self.way = Way(rows, np.cos(mid), np.sin(mid), full)

    def driver(self, volts: np.ndarray, emf: np.ndarray, k: int) -> np.ndarray:
        """Voltage behind the driver's curve, dead zone and gain, as the replay has it; emf : (n,) V, back EMF."""
        get = self.model.get
        dead, gain, share = get("deadzone", k), get("voltage_gain", k), get("fast_decay", k)
        curved = duties(volts, self.supply, get("pwm_curve", k), dead, gain)
        if not share:
            return curved
        plain = duties(volts, self.supply, 0.0, dead, gain)
        return decayed(curved, plain, emf, self.supply, share, get("pwm_periods", k))

    def heat(self, current: np.ndarray, resistance: float, tau: float) -> np.ndarray:
        """First-order response to the winding's loss, (n,), in watts."""
        return first_order(np.minimum(current**2 * resistance, 1e6), np.exp(-self.dt / tau))

    # ---- columns -------------------------------------------------------------------------------------------------
    def put(self, cause: str, block: str, values: np.ndarray) -> None:
        column = self.columns.setdefault(cause, {})
        column[block] = column[block] + values if block in column else values

    def volt_columns(self, cause: str, k: int, end: np.ndarray, mean: np.ndarray, delayed: bool = False) -> None:
        """A voltage beyond the modelled one, just before each row and in the mean of each interval.

        With a measured current only a `delayed` voltage reaches the torque: the samples miss what lies between them.
        """
        res = self.electric[k][0]
        s = self.robot.sides[k]
        if self.has_i[k]:
            self.put(cause, f"current_{s}", end / res)
            if delayed:
                self.torque_columns(cause, k, self.km[k] * (mean - end[1:]) / middles(res))
        else:
            self.torque_columns(cause, k, self.km[k] * mean / middles(res))

    def torque_columns(self, cause: str, k: int, torque: np.ndarray) -> None:
        """A torque beyond the modelled one, (n - 1,) over each interval, at the wheel."""
        self.put(cause, f"torque_{self.robot.sides[k]}", self.cut(cumulated(torque, self.dt)) / self.inertia[k])

    def speed_columns(self, cause: str, k: int, error: np.ndarray, angle: bool) -> None:
        """A reported speed beyond the true one (n,); `angle`: the angle carries the same error."""
        s = self.robot.sides[k]
        res, _, ke, _ = self.electric[k]
        if self.has_i[k] and self.voltage_mode:
            self.put(cause, f"current_{s}", ke * error / res)
        self.put(cause, f"torque_{s}", self.cut(error))
        if not self.has_i[k] and self.voltage_mode:
            self.torque_columns(cause, k, self.km[k] * middles(ke * error / res))
        if self.body:
            other = 1 - k
            self.put(cause, f"torque_{self.robot.sides[other]}", self.cut(error) * self.cross / self.inertia[other])
            if self.gyro is not None:
                lever = (1 if k else -1) * self.model.get("radius", k) / self.model.get("track")
                self.put(cause, "turn", -lever * error)
            if angle and self.way is not None:
                self.way_columns(cause, k, -error)
        if not angle and self.th[k] is not None:
            self.put(cause, f"speed_twice_{s}", -self.cut_twice(cumulated(middles(error), self.dt)))

    def way_columns(self, cause: str, k: int, speed: np.ndarray) -> None:
        """A wheel's way over ground beyond the modelled one: `speed` (n,) rad/s at the wheel."""
        if self.way is None:
            return
        r = self.model.get("radius", k)
        lever = (1 if k else -1) * r / self.model.get("track")
        ds = 0.5 * r * middles(speed) * self.dt
        dyaw = lever * middles(speed) * self.dt
        self.put(cause, "way", self.way_stack(self.way, ds, dyaw))

    @staticmethod
    def way_stack(way: Way, ds: np.ndarray, dyaw: np.ndarray) -> np.ndarray:
        """Yaw, forward and sideways moves of each window, one after the other."""
        rows, c, s, full = way
        parts = [np.diff(np.concatenate([[0.0], np.cumsum(dyaw)])[rows])]
        if full:
            parts += [np.diff(np.concatenate([[0.0], np.cumsum(ds * f)])[rows]) for f in (c, s)]
        return np.concatenate(parts)

    # ---- blocks --------------------------------------------------------------------------------------------------
    def block(self, name: str, residual: np.ndarray, noise: np.ndarray | float, rows: np.ndarray) -> None:
        self.blocks[name] = (residual, np.broadcast_to(noise, residual.shape), rows)
