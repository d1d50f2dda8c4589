"""A recorded run once more in the real-time simulator, from its commands alone."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.correction import layer
from rtds_host.correction.correction import Correction
from rtds_host.correction.coupler import Coupler, set_effects
from rtds_host.correction.formed import with_forms
from rtds_host.correction.translate import translate
from rtds_host.diagnosis.replay.model import Model, row_inputs
from rtds_host.errors import InputError
from rtds_host.link import Link, open_link
from rtds_host.link.quantised import QuantisedLink
from rtds_host.plant.compiled import loop
from rtds_host.plant.schema import OUTPUTS
from rtds_host.plant.sensors import low_pass
from rtds_host.robot import STEP_S, default_engine, make_body, open_engine


@dataclass(frozen=True)
class Setting:
    """How the simulator is put together: link and its options, physics engine, time between two exchanges of torques
    (engine steps), whether the coming exchange's torque is predicted, the motor units' step, s, and whether 12-bit
    converters stand on all wires."""

    link: str = "model"
    link_options: dict = field(default_factory=dict)
    engine: str = field(default_factory=default_engine)
    exchange_steps: int = 1
    predict: bool = True
    step_s: float = 1e-5
    converters: bool = False


@dataclass(frozen=True)
class Simulated:
    """What the sensors would have reported, without noise: `out` (n, 11) at the log's times, columns as the replay's
    `OUTPUTS`; `notes` on what the simulator could not do as asked."""

    out: np.ndarray
    notes: tuple[str, ...]


@loop
def _low_pass(t, values, tau):
    """First-order filter of values that move linearly between unevenly spaced times."""
    out = np.empty_like(values)
    out[0] = values[0]
    for j in range(1, len(t)):
        dt = t[j] - t[j - 1]
        if dt <= 0.0:
            out[j] = out[j - 1]
            continue
        out[j] = low_pass(out[j - 1], values[j], values[j - 1], dt, tau, np.exp(-dt / tau))
    return out


def set_link(link: Link, robot: Robot, correction: Correction | None, setting: Setting) -> None:
    """Give a link the robot's motors and a correction's effects.

    Raises
    ------
    InputError : the link cannot hold them. LinkError : no answer.
    """
    wired = QuantisedLink(link) if setting.converters else link
    wired.set_parameters(*robot.motor.constants, step_s=setting.step_s)
    if correction is not None:
        set_effects(link, correction)


def simulate(
    log: RunLog,
    robot: Robot,
    model: Model | None = None,
    setting: Setting | None = None,
    start: np.ndarray | None = None,
    change: Callable[[Correction, np.ndarray], Correction] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Simulated:
    """Drive the motors of a link and the robot of an engine with a log's commands.

    Parameters
    ----------
    model : the robot as a diagnosis has it; None: the nominal one. start : (15,) as of `row_inputs`, for a heading that
        the log does not hold. change : a last change of the correction, given the start, as by a table. progress :
        called with the time.

    Raises
    ------
    InputError : a robot the simulator does not have, effects the link cannot hold. LinkError : no answer.
    """
    setting = setting or Setting()
    t, _, commands, bus, _, run, known = row_inputs(log, robot)
    start = known if start is None else start
    if robot.driver.mode != "voltage":
        raise InputError(
            f"robot {robot.name!r}: [driver] mode is {robot.driver.mode!r}, the real-time simulator drives by voltage"
        )
    payload_kg, slope_rad, uphill_yaw_rad = (float(value) for value in run[:3])
    body = make_body(robot, payload_kg, slope_rad, uphill_yaw_rad)
    notes: list[str] = []
    correction = None
    if model is not None:
        correction = translate(model, robot, payload_kg, (float(start[3]), float(start[4])), setting.step_s)
        if change is not None:
            correction = change(correction, start)
        body = correction.body_on(body)
    if np.abs(start[5:7]).max() > 0.0:
        notes.append(f"{log.name}: the log starts in motion, the simulator at rest")
    if correction is None and robot.driver.bus == "measured" or correction is not None and correction.bus_measured:
        scale = bus / robot.supply_v
    else:
        scale = np.ones(len(t))
    clipped = np.clip(commands, -robot.supply_v, robot.supply_v)
    with open_link(setting.link, **setting.link_options) as link:
        set_link(link, robot, correction, setting)
        if setting.converters:
            link = QuantisedLink(link)
        with open_engine(setting.engine, body, (float(start[0]), float(start[1]), float(start[2]))) as engine:
            replay = _Replay(t - t[0], clipped, clipped * scale[:, None], correction, setting, robot)
            coupler = Coupler(robot, body, link, engine, correction, setting.exchange_steps, setting.predict)
            replay.drive(coupler, engine, progress)
    return Simulated(replay.reported(start), tuple(notes))


class _Replay:
    """One run: what is sent when, and what is seen when. Times are whole steps of the motor units."""

    def __init__(
        self,
        t: np.ndarray,
        commands: np.ndarray,
        volts: np.ndarray,
        correction: Correction | None,
        setting: Setting,
        robot: Robot,
    ):
        self.step_s, self.setting, self.robot, self.correction = setting.step_s, setting, robot, correction
        self.rows = np.round(t / self.step_s).astype(np.int64)
        self.commands, self.volts = commands, volts
        delay = correction.sensors.delay_s if correction else 0.0
        self.late = np.maximum(self.rows - round(delay / self.step_s), 0)
        self.per_ms = round(STEP_S / self.step_s)
        self.total = -(-int(self.rows[-1]) // self.per_ms)
        changes = np.flatnonzero(np.any(np.diff(volts, axis=0) != 0, axis=1)) + 1
        self.cuts = np.unique(np.concatenate([self.rows[changes], self.rows, self.late]))
        at = np.concatenate([self.rows, self.late])
        self.looked_at = set((at // self.per_ms).tolist()) | set((-(-at // self.per_ms)).tolist())
        self.poses: list[tuple[float, ...]] = []

    def drive(self, coupler: Coupler, engine, progress: Callable[[float], None] | None) -> None:
        block = self.setting.exchange_steps * self.per_ms
        times, speeds, currents = [np.zeros(1)], [np.zeros((1, 2))], [np.zeros((1, 2))]
        done = 0
        behind = self.correction is not None and self.correction.sensors.encoder_at_wheel > 0.0
        wheels: list[np.ndarray] = []

        def look() -> None:
            nonlocal done
            if done in self.looked_at:
                s = engine.state()
                self.poses.append((done * STEP_S, s.x_m, s.y_m, s.yaw_rad, s.yaw_rate_rad_s))
            if behind:
                wheels.append(coupler.state[:, layer.WHEEL].copy())
            done += 1

        look()
        coupler.after_step = look
        for begin in range(0, self.total * self.per_ms, block):
            end = min(begin + block, self.total * self.per_ms)
            inside = self.cuts[np.searchsorted(self.cuts, begin, "right") : np.searchsorted(self.cuts, end, "left")]
            marks = [begin, *inside.tolist(), end]
            pieces = []
            for a, b in itertools.pairwise(marks):
                row = int(np.searchsorted(self.rows, a, side="right")) - 1
                pieces.append((self.volts[row], (b - a) * self.step_s))
            motion = coupler.advance(pieces)
            times.append(begin * self.step_s + motion.t_s)
            speeds.append(motion.speeds)
            currents.append(motion.currents)
            if progress is not None:
                progress(end * self.step_s)
        self.t = np.concatenate(times)
        self.speeds, self.currents = np.concatenate(speeds), np.concatenate(currents)
        # What the encoders see: the rotors at the gear's output, or the wheels.
        self.seen_t: np.ndarray = self.t
        self.seen: np.ndarray = self.speeds
        if behind:
            self.seen_t, self.seen = np.arange(len(wheels)) * STEP_S, np.array(wheels)

    def reported(self, start: np.ndarray) -> np.ndarray:
        """(n, 11), columns as `OUTPUTS`."""
        s = self.correction.sensors if self.correction else None
        supply = self.correction.supply if self.correction else None
        out = np.empty((len(self.rows), len(OUTPUTS)))
        at, pose_at = self.late * self.step_s, self.rows * self.step_s
        draw = np.zeros(len(at))
        late_by = supply.command_delay_s if supply else 0.0
        in_force = np.searchsorted(self.rows, self.late - round(late_by / self.step_s), side="left") - 1
        for k in range(2):
            current = np.interp(at, self.t, self.currents[:, k])
            volts = np.where(in_force >= 0, self.commands[np.maximum(in_force, 0), k], 0.0)
            draw += current * volts / self.robot.supply_v
            speed = self.seen[:, k]
            angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(self.seen_t) * (speed[1:] + speed[:-1]))])
            if s is not None and s.speed_filter_s[k] > 0.0:
                speed = _low_pass(self.seen_t, np.ascontiguousarray(speed), s.speed_filter_s[k])
            gain = s.speed_gain[k] if s else 1.0
            out[:, 1 + k] = current * (s.current_gain[k] if s else 1.0) + (s.current_bias_a[k] if s else 0.0)
            out[:, 3 + k] = np.interp(at - (s.speed_delay_s[k] if s else 0.0), self.seen_t, speed) * gain
            out[:, 5 + k] = start[3 + k] + np.interp(at, self.seen_t, angle) * gain
        out[:, 0] = self.robot.supply_v
        if supply is not None:
            out[:, 0] -= supply.source_resistance_ohm * draw + supply.decline_v_per_s * at
        poses = np.array(self.poses)
        rate = np.interp(at, poses[:, 0], poses[:, 4])
        out[:, 7] = rate * (s.gyro_gain if s else 1.0) + (s.gyro_bias_rad_s if s else 0.0)
        if s is not None:
            with_forms(s.forms, out, at)
        for column in (8, 9, 10):
            out[:, column] = np.interp(pose_at, poses[:, 0], poses[:, column - 7])
        return out
