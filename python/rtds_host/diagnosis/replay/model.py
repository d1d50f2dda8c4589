"""A robot as the kernel sees it, and one call that replays a run on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis.replay import kernel
from rtds_host.diagnosis.replay.simd import replay_batch
from rtds_host.diagnosis.start import DECLARED, Start
from rtds_host.diagnosis.thresholds import SIGNIFICANT
from rtds_host.plant.forms import no_forms
from rtds_host.plant.schema import COMMON, COMMON_INDEX, OUTPUT_INDEX, OUTPUTS, SIDE, SIDE_INDEX

# Numerical: longest step of the search: its error moves no sample by more than about a quarter of its noise (steps of
# 20 V), and chi2 by a few units. What is reported is replayed at `REPORT_STEP_S`, at which these are a tenth of that.
STEP_S = 1.7e-3
REPORT_STEP_S = 5.0e-4
# Numerical: slip brings faster modes, springs may bring faster ones still, and so does free play between its flanks.
SLIP_STEP_S = 8.4e-4
FINE_STEP_S = 4.0e-4
# Numerical: how much longer steps are where replays are only compared with one another, and where one has a spring.
COARSER, COARSER_SPRING = 3.0, 2.0
# Numerical: from how many at a time, in the mean, replays are done sooner in a batch than one by one; with springs,
# with free play, and with free play and slip.
FEWEST, FEWEST_OF_SPRINGS, FEWEST_OF_PLAY, FEWEST_OF_PLAY_AND_SLIP = 2.2, 2.6, 4.0, 3.0
# Numerical: a spring's step in its fastest swing: the errors then are those above at any stiffness that swings visibly.
SPRING_STEP_RAD = 0.1
# Numerical: a piece starts from a parabola over so many rows to either side.
START_ROWS = 2
# Numerical: of a robot's mass at its wheel's rim, too little to matter.
WEIGHTLESS = 1e-6
# Physical: no command and no measurement comes later than this, a radio link's included.
LONGEST_DELAY_S = 1.0
# How a driver is commanded, in the kernels' order.
MODES = ("voltage", "torque", "speed")
# Outputs of devices with a clock of their own.
CLOCKS = {
    "gyro_delay": slice(OUTPUT_INDEX["gyro_z"], OUTPUT_INDEX["gyro_z"] + 1),
    "pose_delay": slice(OUTPUT_INDEX["x"], OUTPUT_INDEX["yaw"] + 1),
}


@dataclass
class Model:
    """Numbers of one robot: `side` (2, len(SIDE)) and `common` (len(COMMON),), addressed by name; `forms` (2, MOST,
    WIDTH), see `plant.forms`; `start`: how its runs begin where that was estimated."""

    side: np.ndarray
    common: np.ndarray
    forms: np.ndarray = field(default_factory=no_forms)
    start: Start = DECLARED

    @property
    def numbers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """What the kernel takes of it: parameters of the sides, those in common and forms, None without any."""
        return self.side, self.common, self.forms if self.forms.any() else None

    def copy(self) -> Model:
        """An independent copy."""
        return self.with_start(self.start)

    def with_start(self, start: Start) -> Model:
        """An independent copy whose runs begin otherwise."""
        return Model(self.side.copy(), self.common.copy(), self.forms.copy(), start)

    def _entries(self, name: str, sides: tuple[int, ...]) -> tuple[np.ndarray, Sequence[Any]]:
        """Where an entry is, of the given sides if it has sides: the array and the places in it, one by one, since a
        slice of two takes longer."""
        at = SIDE_INDEX.get(name)
        if at is None:
            return self.common, (COMMON_INDEX[name],)
        return self.side, [(side, at) for side in sides]

    def scale(self, name: str, factor: float, sides: tuple[int, ...] = (0, 1)) -> None:
        """Multiply an entry, of the given sides if it has sides."""
        values, places = self._entries(name, sides)
        for place in places:
            values[place] *= factor

    def add(self, name: str, value: float, sides: tuple[int, ...] = (0, 1)) -> None:
        """Add to an entry, of the given sides if it has sides."""
        values, places = self._entries(name, sides)
        for place in places:
            values[place] += value

    def put(self, name: str, value: float, sides: tuple[int, ...] = (0, 1)) -> None:
        """Set an entry, of the given sides if it has sides."""
        values, places = self._entries(name, sides)
        for place in places:
            values[place] = value

    def declare(self, **values: float) -> None:
        """Set several entries, of both sides where they have sides."""
        for name, value in values.items():
            self.put(name, value)

    def get(self, name: str, side: int = 0) -> float:
        """One entry."""
        if name in SIDE_INDEX:
            return self.side.item(side, SIDE_INDEX[name])
        return self.common.item(COMMON_INDEX[name])

    @property
    def step_s(self) -> float:
        """Longest step that resolves what is switched on (free play asks for shorter ones between its flanks only)."""
        step = SLIP_STEP_S if self._has("slip") else STEP_S
        stiffness = max(self.get("stiffness", 0), self.get("stiffness", 1))
        if stiffness <= 0.0:
            return step
        rotor = self.get("gear_ratio") ** 2 * self.get("rotor_inertia")
        least = min(self._load_inertia(), rotor)
        if least <= 0.0:
            return FINE_STEP_S
        fastest = math.sqrt(2.0 * stiffness / least)
        return min(max(SPRING_STEP_RAD / fastest, FINE_STEP_S), step)

    def _load_inertia(self) -> float:
        """Inertia that a wheel feels which alone is accelerated, kg m2 (of an axis: its load's); 0 where there
        is none.
        """
        arm = self.get("axis_arm")
        if self.get("axis") > 0:
            return self.get("axis_inertia") + self.get("axis_mass") * arm**2
        # The declared mass: what a run carries next to it only slows the swing.
        mass, half = self.get("mass"), 0.5 * self.get("track")
        if mass <= 0.0:
            return 0.0
        return self.get("wheel_inertia") + self.get("radius") ** 2 / (1.0 / mass + half**2 / self.get("yaw_inertia"))

    @property
    def coarse_s(self) -> float:
        """The same for replays that are only compared with one another; a spring's swing, a tyre's shear
        or the moment when flanks meet is what is looked for there."""
        if self._has("slip", "backlash"):
            return self.step_s
        return (COARSER_SPRING if self._has("stiffness") else COARSER) * self.step_s

    @property
    def slow(self) -> bool:
        """Whether it takes many small steps to replay."""
        return self._has("stiffness", "slip", "backlash")

    @property
    def waits(self) -> bool:
        """Whether lanes wait for one another where its replays go in a batch: for their free play."""
        return self._has("backlash")

    @property
    def iterated(self) -> bool:
        """Whether a step is taken again with its own result, on which its friction or its bus depends."""
        return self._has("load_share") or self.get("source_resistance") != 0.0

    @property
    def fewest(self) -> float:
        """How many of its replays must go on at a time, in the mean, to be done sooner in a batch than one by one. A
        tyre's shear costs little in a batch; where lanes wait for one another's free play, much."""
        if self.waits:
            return FEWEST_OF_PLAY_AND_SLIP if self._has("slip") else FEWEST_OF_PLAY
        return FEWEST_OF_SPRINGS if self._has("stiffness") else FEWEST

    @property
    def has_servo(self) -> bool:
        """Whether a servo holds its speed, whose samples end steps."""
        return self.get("mode") == MODES.index("speed")

    def _has(self, *names: str) -> bool:
        # A search asks this of each of its models, several times.
        at, width = self.side.item, self.side.shape[1]
        for name in names:
            k = SIDE_INDEX[name]
            if at(k) != 0.0 or at(width + k) != 0.0:
                return True
        return False


def nominal_model(robot: Robot) -> Model:
    """The nominal robot of the contract (section 2), or the single axis of its section 7."""
    side = np.array([entry.nominal or 0.0 for entry in SIDE.values()])
    model = Model(np.vstack([side, side]), np.array([entry.nominal or 0.0 for entry in COMMON.values()]))
    motor, driver, torque_mode = robot.motor, robot.driver, robot.driver.mode == "torque"
    if torque_mode:
        # The electrical values play no part; any finite ones serve.
        model.declare(resistance=1.0, inductance=1.0, torque_constant=0.0, back_emf=0.0)
        model.declare(torque_per_volt=driver.torque_nm_per_v)
    else:
        model.declare(resistance=motor.resistance_ohm, inductance=motor.inductance_h)
        model.declare(torque_constant=motor.torque_constant_nm_per_a, back_emf=motor.back_emf_constant_v_s_per_rad)
    model.declare(rotor_inertia=motor.rotor_inertia_kg_m2, viscous=motor.viscous_friction_nm_s_per_rad)
    model.declare(gear_ratio=motor.gear_ratio, supply=robot.supply_v, encoder_at_wheel=robot.encoder == "wheel")
    model.declare(mode=MODES.index(driver.mode), bus_measured=driver.bus == "measured")
    if robot.servo is not None:
        servo = robot.servo
        model.declare(servo_kp=servo.kp_v_s_per_rad, servo_ki=servo.ki_v_per_rad)
        model.declare(servo_limit=servo.limit_v, servo_period=servo.period_s)
    if robot.chassis is not None:
        body = robot.chassis
        # A wheel without inertia would have no speed of its own while its gear's flanks are apart.
        least = WEIGHTLESS * body.mass_kg * body.wheel_radius_m**2
        model.declare(mass=body.mass_kg, yaw_inertia=body.yaw_inertia_kg_m2, track=body.track_width_m)
        model.declare(wheel_inertia=max(body.wheel_inertia_kg_m2, least), radius=body.wheel_radius_m)
        model.declare(com_x=body.com_x_m, com_y=body.com_y_m)
    else:
        axis = robot.sole_axis
        arm = axis.length_m if axis.kind == "pendulum" else axis.metres_per_rad
        model.declare(axis=["inertia", "pendulum", "linear"].index(axis.kind) + 1, axis_arm=arm)
        model.declare(axis_inertia=axis.inertia_kg_m2, axis_mass=axis.mass_kg, axis_zero=axis.zero_rad)
    return model


def _filled(log: RunLog, name: str, default: float) -> np.ndarray:
    """The channel with each gap holding the last sample, and its first sample before that."""
    values = log.columns.get(name)
    if values is None or not np.isfinite(values).any():
        return np.full(len(log.t), default)
    good = np.isfinite(values)
    last = np.maximum.accumulate(np.where(good, np.arange(len(values)), -1))
    return values[np.where(last >= 0, last, np.argmax(good))]


def start_state(log: RunLog, robot: Robot) -> np.ndarray:
    """State at the first row (15,): x, y, yaw, th_l, th_r, w_l, w_r, i_l, i_r; w_l, w_r, i_l, i_r as reported, a
    current that was not, or is no more than noise, NaN; and what of either current noise may be.

    A robot starts at rest unless its first samples say otherwise by more than noise reaches (contract,
    section 2); a single axis starts as its first row says (section 7).
    """
    start = np.zeros(15)
    for k, name in enumerate(("x", "y", "yaw", "th_l", "th_r")):
        if log.has(name):
            start[k] = _filled(log, name, 0.0)[0]
    for k, name in enumerate(("w_l", "w_r", "i_l", "i_r")):
        values = log.columns.get(name)
        if values is None or not np.isfinite(values[0]):
            continue
        noise = robot.noise(name) or 0.0
        if robot.axis is not None or abs(values[0]) > SIGNIFICANT * noise + 1e-9:
            start[5 + k] = values[0]
    start[9:11] = start[5:7]
    start[11:13] = np.where(start[7:9] != 0.0, start[7:9], np.nan)
    if robot.axis is None:
        start[13:] = [SIGNIFICANT * (robot.noise(name) or 0.0) for name in ("i_l", "i_r")]
    return start


def run_inputs(log: RunLog, robot: Robot) -> tuple[np.ndarray, ...]:
    """What the kernel needs of a run: sample times (n,), command times (m,), commands (m, 2), bus (m,), angles to
    follow (0, 2), run (4,), start (15,).

    Times count from the run's first row: since 1970 a double has a quarter of a microsecond, and steps add up.
    A machine that moves in the first row was under command before: under that row's, for as long as a command may act
    late.
    """
    t, t_cmd, commands, bus, angle, run, start = row_inputs(log, robot)
    return (t, *_from_before(t_cmd, commands, bus, robot, start), angle, run, start)


def _from_before(
    t_cmd: np.ndarray, commands: np.ndarray, bus: np.ndarray, robot: Robot, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Commands of a run from its first row on, with that from before of a machine that begins moving."""
    noise = [SIGNIFICANT * (robot.noise(name) or 0.0) for name in ("w_l", "w_r")]
    if np.all(np.abs(start[5:7]) <= noise):
        return t_cmd, commands, bus
    return np.append(-LONGEST_DELAY_S, t_cmd), np.vstack([commands[:1], commands]), np.append(bus[0], bus)


def row_inputs(log: RunLog, robot: Robot) -> tuple[np.ndarray, ...]:
    """The same with a command a row, none from before."""
    commands = log.commands(robot.driver.mode)
    if commands.shape[1] == 1:
        commands = np.column_stack([commands[:, 0], np.zeros(len(commands))])
    run = np.array([log.meta.payload_kg, log.meta.slope_rad, log.meta.uphill_yaw_rad, -log.since_s])
    t, bus = log.t - log.t[0], _filled(log, "v_bus", robot.supply_v)
    return t, t, np.ascontiguousarray(commands), bus, np.empty((0, 2)), run, start_state(log, robot)


def following(inputs: tuple[np.ndarray, ...], log: RunLog) -> tuple[np.ndarray, ...]:
    """The inputs of a run, or of a piece of it, with a ripple that follows the measured angles."""
    t_cmd, start = inputs[1], inputs[6]
    angle = np.column_stack(
        [np.interp(t_cmd, log.t - log.t[0], measured_angle(log, side, start[3 + k])) for k, side in enumerate("lr")]
    )
    return (*inputs[:4], angle, *inputs[5:])


def measured_angle(log: RunLog, side: str, start: float) -> np.ndarray:
    """A wheel's measured angle at the rows (n,), rad, or what its measured speed adds up to; `start` without either."""
    th, w = log.columns.get(f"th_{side}"), log.columns.get(f"w_{side}")
    if th is not None and np.isfinite(th).sum() > 1:
        good = np.isfinite(th)
        return np.interp(log.t, log.t[good], th[good])
    if w is None or not np.isfinite(w).any():
        return np.full(len(log.t), start)
    return start + np.concatenate([[0.0], np.cumsum(_filled(log, f"w_{side}", 0.0)[:-1] * np.diff(log.t))])


def stretch_inputs(log: RunLog, robot: Robot, first: int, last: int) -> tuple[np.ndarray, ...]:
    """The same for rows first <= k < last of a robot's run, started from what is measured at the first of them."""
    inputs = row_inputs(log, robot)
    start = start_state(log.rows(first, last), robot)
    t, t_cmd, commands, bus, angle, run, _ = _cut(inputs, first, last, start)
    if first == 0:
        t_cmd, commands, bus = _from_before(t_cmd, commands, bus, robot, start)
    return t, t_cmd, commands, bus, angle, run, start


def piece_inputs(log: RunLog, robot: Robot, first: int, last: int) -> tuple[np.ndarray, ...]:
    """The same for rows first <= k < last of a single axis, started from the measured state there.

    Angle and speed come from a parabola through the angles about the start where there are enough (it leads no
    filter and no delay into the state), else from the speed's own samples. Commands from before stay known, for effects
    that make them late.
    """
    inputs = row_inputs(log, robot)
    t, _, commands, bus, _, _, start = inputs
    half = START_ROWS * float(np.median(np.diff(t)))
    about = np.abs(t - t[first]) <= half * (1.0 + 1e-6)
    for k, side in enumerate(robot.sides):
        speed = _line(t, log.columns.get(f"w_{side}"), about, t[first])
        turned = _line(t, log.columns.get(f"th_{side}"), about, t[first])
        start[9 + k] = _at(log, f"w_{side}", first, start[9 + k]) if speed is None else speed[0]
        start[5 + k] = start[9 + k] if turned is None else turned[1]
        start[3 + k] = _at(log, f"th_{side}", first, start[3 + k]) if turned is None else turned[0]
        if robot.driver.mode == "voltage":
            motor = robot.motor
            # A row holds the state just before its command acts.
            held = max(first - 1, 0)
            volts = commands[held, k] * (bus[held] / robot.supply_v if robot.driver.bus == "measured" else 1.0)
            # Across the few electrical time constants that a start lasts, the winding is in its steady state.
            start[11 + k] = np.nan
            emf = motor.back_emf_constant_v_s_per_rad * motor.gear_ratio * start[5 + k]
            start[7 + k] = (volts - emf) / motor.resistance_ohm
    return _cut(inputs, first, last, start)


def _cut(inputs: tuple[np.ndarray, ...], first: int, last: int, start: np.ndarray) -> tuple[np.ndarray, ...]:
    """Inputs of rows first <= k < last that begin at `start`, with the commands from before that may still act."""
    t, _, commands, bus, angle, run, _ = inputs
    before = max(0, int(np.searchsorted(t, t[first] - LONGEST_DELAY_S, side="right")) - 1)
    parts = (part[before:last] for part in (t, commands, bus))
    return (t[first:last].copy(), *(np.ascontiguousarray(part) for part in parts), angle, run, start)


def _at(log: RunLog, name: str, row: int, default: float) -> float:
    """A channel at a row, between its samples; `default` without any."""
    values = log.columns.get(name)
    if values is None or not np.isfinite(values).any():
        return default
    good = np.isfinite(values)
    return float(np.interp(log.t[row], log.t[good], values[good]))


def _line(t: np.ndarray, values: np.ndarray | None, rows: np.ndarray, at: float) -> tuple[float, float] | None:
    """Value and slope at a time, of a parabola through the samples in some rows; None with fewer than five."""
    if values is None:
        return None
    good = rows & np.isfinite(values)
    if good.sum() < 2 * START_ROWS + 1:
        return None
    coefficients = np.polyfit(t[good] - at, values[good], 2)
    return float(coefficients[2]), float(coefficients[1])


def replay_run(model: Model, inputs: tuple[np.ndarray, ...], step_s: float | None = None) -> np.ndarray:
    """Replay one run from its commands.

    Parameters
    ----------
    model : the robot; inputs : from `run_inputs`; step_s : longest step, by default what the model needs.

    Returns
    -------
    (n, 11) what the sensors would report without noise, columns as `OUTPUTS`, SI.
    """
    out = np.empty((len(inputs[0]), len(OUTPUTS)))
    longest = step_s or model.step_s
    kernel.replay(*inputs[:5], *model.numbers, *inputs[5:], longest, FINE_STEP_S, out)
    _on_clocks(model, inputs[0], np.array([0, len(out)]), out)
    return out


def _on_clocks(model: Model, t: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """Let replays' outputs (n, 11) at times t (n,) come from the clocks of their devices; rows : where runs begin, and
    where the last one ends.
    """
    late = [(delay_s, part) for quantity, part in CLOCKS.items() if (delay_s := model.get(quantity))]
    if late:
        columns = np.array([(part.start, part.stop) for _, part in late])
        _delay(t, rows, np.array([delay_s for delay_s, _ in late]), out, columns)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _delay(t, rows, delays_s, out, columns):
    """Let some `columns` (m, 2), from and to, of `out` (n, 11) at times t (n,) be those of `delays_s` (m,) earlier, as
    `np.interp` has them, run by run. A negative delay is that of the others.
    """
    for r in range(len(rows) - 1):
        first, last = rows[r], rows[r + 1]
        # One device after the other of a run, which stays in the cache.
        for n in range(len(delays_s)):
            delay_s, begin, end = delays_s[n], columns[n, 0], columns[n, 1]
            # From the end on where values come from before, so that these are not overwritten yet.
            row = last - 1 if delay_s > 0.0 else first
            for i in range(last - 1, first - 1, -1) if delay_s > 0.0 else range(first, last):
                at = t[i] - delay_s
                while delay_s > 0.0 and row > first and t[row] > at:
                    row -= 1
                while delay_s < 0.0 and row + 1 < last and t[row + 1] <= at:
                    row += 1
                if at > t[row] and row + 1 < last:
                    span, past = t[row + 1] - t[row], at - t[row]
                    for k in range(begin, end):
                        out[i, k] = out[row, k] + (out[row + 1, k] - out[row, k]) / span * past
                else:
                    for k in range(begin, end):
                        out[i, k] = out[row, k]


class ReplayBatch:
    """Several runs one after another in memory, for replays that go in a batch, see `simd`."""

    def __init__(self, inputs: list[tuple[np.ndarray, ...]]):
        self.inputs = inputs
        t, t_cmd, commands, bus, angle = (
            np.ascontiguousarray(np.concatenate([run[k] for run in inputs])) for k in range(5)
        )
        self.t = t
        self.rows, at_cmd, at_angle = (
            np.concatenate([[0], np.cumsum([len(run[k]) for run in inputs])]) for k in (0, 1, 4)
        )
        runs = np.array([run[5] for run in inputs])
        self._in_memory = t, self.rows, t_cmd, commands, bus, at_cmd, angle, at_angle, runs
        # The longest first: those that come last go on by themselves.
        self.order = np.argsort(-np.diff(self.rows), kind="stable")

    def worth(self, models: list[Model]) -> bool:
        """Whether replays of some models are done sooner in a batch: how many go on at a time in the mean, with the
        longest run's to wait for.

        Not by how many cores there are: a replay in a batch differs from one alone in its last digits, and of two
        explanations that are as good as each other these would choose."""
        fewest = max((model.fewest for model in models), default=math.inf)
        return len(models) * float(self.rows[-1]) >= fewest * max(float(np.diff(self.rows).max(initial=0)), 1.0)

    def replay_alone(self, model: Model, first: int, last: int, step_s: float) -> np.ndarray:
        """Replays (rows, 11) of some runs, from `first` to before `last`, of any model: as of `replay_run`."""
        out = np.empty((self.rows[last] - self.rows[first], len(OUTPUTS)))
        steps = step_s, FINE_STEP_S
        kernel.replay_runs(self._in_memory, self._starts(first, last), first, model.numbers, steps, out)
        start, stop = self.rows[first], self.rows[last]
        _on_clocks(model, self.t[start:stop], self.rows[first : last + 1] - start, out)
        return out

    def replay(self, models: list[Model], steps: Sequence[float | None] | None = None) -> np.ndarray:
        """Replays (models, rows of all runs, 11), columns as `OUTPUTS`; steps : as of `replay_run`."""
        longest = [step or model.step_s for model, step in zip(models, steps or [None] * len(models))]
        out = np.empty((len(models), self.rows[-1], len(OUTPUTS)))
        which = np.array([(k, run) for run in self.order for k in range(len(models))])
        self._fill(models, longest, which, which[:, 0] * self.rows[-1] + self.rows[which[:, 1]], out)
        for model, mine in zip(models, out):
            _on_clocks(model, self.t, self.rows, mine)
        return out

    def replay_each(self, models: list[Model], runs: Sequence[int]) -> list[np.ndarray]:
        """Replays (n, 11) of one run with each model, columns as `OUTPUTS`."""
        if len(models) < max((model.fewest for model in models), default=math.inf):
            return [replay_run(model, self.inputs[run]) for model, run in zip(models, runs, strict=True)]
        lengths = np.diff(self.rows)[list(runs)]
        first = np.concatenate([[0], np.cumsum(lengths)])
        out = np.empty((first[-1], len(OUTPUTS)))
        # The longest first, as above.
        order = np.argsort(-lengths, kind="stable")
        which = np.column_stack([np.arange(len(models)), runs])[order]
        self._fill(models, [model.step_s for model in models], which, first[:-1][order], out)
        found = np.split(out, first[1:-1])
        for model, run, mine in zip(models, runs, found, strict=True):
            _on_clocks(model, self.inputs[run][0], np.array([0, len(mine)]), mine)
        return found

    def _fill(
        self, models: list[Model], longest: list[float], which: np.ndarray, first: np.ndarray, out: np.ndarray
    ) -> None:
        """Replay models on runs, `which` (jobs, 2), with `longest` steps, s, each from its row of `out` on, `first`."""
        numbers = tuple(np.array([getattr(m, part) for m in models]) for part in ("side", "common", "forms"))
        starts, flat = self._starts(0, len(self.inputs)), out.reshape(-1, len(OUTPUTS))
        replay_batch(self._in_memory, starts, numbers, np.array(longest), FINE_STEP_S, which, flat, first)

    def _starts(self, first: int, last: int) -> np.ndarray:
        """Where runs begin, which may have been estimated again."""
        return np.array([run[6] for run in self.inputs[first:last]])
