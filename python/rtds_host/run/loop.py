"""The loop: controller, driver, motor units, robot, sensors; once an exchange."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtds_host.control import Controller, Observation, make_controller
from rtds_host.correction import layer
from rtds_host.correction.correction import Correction
from rtds_host.correction.coupler import Coupler, set_effects
from rtds_host.errors import InputError
from rtds_host.faults.inject import FaultLink
from rtds_host.faults.timeline import Injection
from rtds_host.link import Link, open_link
from rtds_host.robot import STEP_S, Body, Engine, open_engine
from rtds_host.run.fault_path import FaultPath
from rtds_host.run.path import Sample, SignalPath
from rtds_host.run.plan import Plan
from rtds_host.run.sensors import CorrectedPath
from rtds_host.scenario import SpeedMotion, reference_poses, wheel_references
from rtds_host.vectors import given

# Opens an engine of a name with a body at a pose, as `rtds_host.robot.open_engine` does.
OpenEngine = Callable[[str, Body, tuple[float, float, float]], Engine]


@dataclass(frozen=True)
class Record:
    """What happened. n engine steps, m exchanges, k rows of the log. Wheel side but where said; [left, right].

    Attributes
    ----------
    t_s : (n + 1,) s.
    speeds, currents : (n + 1, 2) rad/s and A, of the motor units, at every engine step.
    references : (n + 1, 2) rad/s or None (a run by voltage).
    reference_poses : (n + 1, 3) m, m, rad, or None.
    starts, ends : (m,) engine steps at which each exchange began and ended.
    commanded, applied : (m, 2) V, asked for and at the motors; `applied` is float32.
    shaft_torques : (m, 2) float32, N m at the motor shaft, held over the exchange; without the torque of what the motor
        units carry of the body.
    reflected_kg_m2 : (2,) inertia of the body at each wheel, reflected into the motor units (`rtds_host.robot.split`).
    rows : (k,) engine steps of the log's rows; `samples` their measured values, `truth` the true ones.
    engine_energy_j : energy of the robot gained over the run. wall_s : time the loop took.
    link_report : what the link has to say about itself (pacing, clocks, ranges that cut), or None.
    """

    t_s: np.ndarray
    speeds: np.ndarray
    currents: np.ndarray
    references: np.ndarray | None
    reference_poses: np.ndarray | None
    starts: np.ndarray
    ends: np.ndarray
    commanded: np.ndarray
    applied: np.ndarray
    shaft_torques: np.ndarray
    rows: np.ndarray
    samples: list[Sample]
    truth: list[Sample]
    engine_energy_j: float
    reflected_kg_m2: np.ndarray
    wall_s: float
    link_report: dict | None = None


def set_motors(link: Link, plan: Plan, carry: bool = True) -> None:
    """Give the link the plan's motor parameters; `carry`: with the inertia that the units carry for the body.

    Raises
    ------
    InputError : parameters the core refuses. LinkError : no answer.
    """
    motor = plan.unit_motor if carry else plan.robot.motor
    link.set_parameters(*motor.constants, step_s=plan.simulator_step_s, method=plan.method)


def drive(
    plan: Plan,
    link: Link,
    path: SignalPath | None = None,
    progress: Callable[[float], None] | None = None,
    correction: Correction | None = None,
    engine_of: OpenEngine = open_engine,
    injection: Injection | None = None,
) -> Record:
    """Drive one run through an open link.

    Parameters
    ----------
    path : what is between controller, motors, robot and log; by default that of `default_path`. One that is given
        has the injection's sensors in it already.
    progress : is called with the simulated time, s, once an exchange.
    correction : makes it another robot than the nominal one. With it, and where the body outweighs the rotors, motors
    and
        robot exchange torques each engine step without lag, whatever the controller's interval.
    engine_of : opens the physics engine, of the plan's name, with the body at its first pose.
    injection : faults and played signals (`rtds_host.faults`).

    Raises
    ------
    InputError : parameters or times the link cannot take. LinkError : the link does not answer.
    """
    if injection is not None:
        if plan.coupling != "closed":
            raise InputError(f"coupling {plan.coupling!r}: faults and a stimulus need coupling 'closed'")
        link = FaultLink(link, injection)
    set_motors(link, plan, carry=correction is None)
    body = plan.body
    if correction is not None:
        if plan.coupling != "closed":
            raise InputError(
                f"coupling {plan.coupling!r}: effects need coupling 'closed', where the robot follows its motors"
            )
        body = correction.body_on(plan.body)
        set_effects(link, correction)
    path = path or default_path(plan, correction, injection)
    with engine_of(plan.engine, body, plan.motion.start) as engine:
        began = time.perf_counter()
        coupler = None
        if correction is not None or injection is not None or plan.reflected_kg_m2:
            coupler = Coupler(plan.robot, body, link, engine, correction, reflected_kg_m2=plan.reflected_kg_m2)
        record = _Loop(plan, link, engine, path, coupler, correction, injection).run(progress)
        report = getattr(link, "report", None)
        return Record(**record, wall_s=time.perf_counter() - began, link_report=report() if report else None)


def default_path(plan: Plan, correction: Correction | None = None, injection: Injection | None = None) -> SignalPath:
    """A run's signal path: the nominal one or that of a correction's sensors, with an injection's faults."""
    supply_v = plan.robot.supply_v
    path = SignalPath(supply_v) if correction is None else CorrectedPath(supply_v, correction.sensors)
    return path if injection is None else FaultPath(path, injection)


def drive_with(
    plan: Plan,
    link_name: str,
    link_options: dict | None = None,
    path: SignalPath | None = None,
    progress: Callable[[float], None] | None = None,
    correction: Correction | None = None,
    engine_of: OpenEngine = open_engine,
    injection: Injection | None = None,
) -> Record:
    """Open a link, drive one run through it, close it. See `drive` and `rtds_host.link.open_link`."""
    with open_link(link_name, **(link_options or {})) as link:
        return drive(plan, link, path, progress, correction, engine_of, injection)


class _Loop:
    def __init__(
        self,
        plan: Plan,
        link: Link,
        engine: Engine,
        path: SignalPath,
        coupler: Coupler | None = None,
        correction: Correction | None = None,
        injection: Injection | None = None,
    ):
        self.plan, self.link, self.engine, self.path = plan, link, engine, path
        self.coupler, self.correction, self.injection = coupler, correction, injection
        self.ratio = plan.robot.motor.gear_ratio
        count = plan.total_steps + 1
        self.t = np.arange(count) * STEP_S
        self.speeds, self.currents = np.zeros((count, 2)), np.zeros((count, 2))
        self.angles = np.zeros(2)
        # What the encoders see: the motor units' speeds, or those of wheels behind free play and springs.
        self.behind = np.zeros(2, bool)
        if coupler is not None and correction is not None and correction.sensors.encoder_at_wheel > 0.0:
            self.behind = coupler.elastic
        self.seen = np.zeros((count, 2)) if self.behind.any() else self.speeds
        self.references: np.ndarray | None = None
        self.poses: np.ndarray | None = None
        self.controller: Controller | None = None
        self.voltages: np.ndarray | None = None
        motion = plan.motion
        if isinstance(motion, SpeedMotion):
            self.references = wheel_references(motion, plan.robot, self.t)
            self.poses = reference_poses(motion, STEP_S)
            self.controller = make_controller(
                given(plan.controller, "controller"), plan.unit_motor, plan.robot.supply_v
            )
        else:
            period = round(motion.period_s / STEP_S)
            self.voltages = motion.voltages((np.arange(count) // period * period) * STEP_S)

    def run(self, progress: Callable[[float], None] | None) -> dict:
        plan, engine = self.plan, self.engine
        total = plan.total_steps
        torque = engine.hold()
        energy = engine.energy_j()
        rows, samples, truth = [], [], []
        starts = np.arange(0, total, plan.exchange_steps)
        ends = np.minimum(starts + plan.exchange_steps, total)
        commanded, applied = np.zeros((len(starts), 2)), np.zeros((len(starts), 2), np.float32)
        loads = np.zeros((len(starts), 2), np.float32)
        sent: list[np.ndarray] = []
        if self.path.watches:
            self.path.watch(self.t[0], self._sample(0))

        def look(step: int) -> tuple[Sample, Sample]:
            seen = self._sample(step)
            measured = self.path.sensors(self.t[step], seen)
            rows.append(step)
            truth.append(seen)
            samples.append(measured)
            return seen, measured

        for k, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
            at_row = start % plan.log_steps == 0
            seen, measured = look(start) if at_row else (self._sample(start),) * 2
            loads[k] = self.path.loads(self.t[start], torque, seen) / self.ratio
            commanded[k] = self._command(start, end, measured, loads[k])
            applied[k] = self.path.voltages(self.t[start], commanded[k], seen)
            if self.coupler is not None:
                sent += self._move_together(self.coupler, start, end, applied[k], look)
                torque = self.coupler.load
                if progress is not None:
                    progress(self.t[end])
                continue
            interval = (end - start) * STEP_S
            got = self.link.exchange(applied[k], loads[k], interval, STEP_S)
            self.speeds[start + 1 : end + 1] = got.speeds.astype(np.float64) / self.ratio
            self.currents[start + 1 : end + 1] = got.currents
            torque = self._move_robot(start, end, torque, look)
            if progress is not None:
                progress(self.t[end])
        look(total)
        if self.coupler is not None:
            often = ends - starts
            starts, loads = np.arange(total), np.array(sent)
            ends, commanded, applied = (
                starts + 1,
                np.repeat(commanded, often, axis=0),
                np.repeat(applied, often, axis=0),
            )
            self._note_played(commanded)
        return {
            "t_s": self.t,
            "speeds": self.speeds,
            "currents": self.currents,
            "references": self.references,
            "reference_poses": self.poses,
            "starts": starts,
            "ends": ends,
            "commanded": commanded,
            "applied": applied,
            "shaft_torques": loads,
            "rows": np.array(rows),
            "samples": samples,
            "truth": truth,
            "engine_energy_j": engine.energy_j() - energy,
            "reflected_kg_m2": np.zeros(2) if self.coupler is None else self.coupler.reflected,
        }

    def _command(self, start: int, end: int, measured: Sample, load: np.ndarray) -> np.ndarray:
        if self.voltages is not None:
            return self.voltages[start].astype(np.float32).astype(np.float64)
        references, controller = given(self.references, "references"), given(self.controller, "controller")
        if self.coupler is not None and self.plan.reflected_kg_m2:
            # The controller's motors carry a part of the body; the rest loads them as they speed up, both wheels
            # together.
            rise = (references[end] - measured.speeds_rad_s) / ((end - start) * STEP_S)
            load = (self.coupler.load_of(rise) - self.plan.reflected_kg_m2 * rise) / self.ratio
        seen = Observation(
            speeds_rad_s=measured.speeds_rad_s * self.ratio,
            currents_a=measured.currents_a,
            torques_nm=load.astype(np.float64),
        )
        volts = controller.command(
            seen, references[start] * self.ratio, references[end] * self.ratio, (end - start) * STEP_S
        )
        # The link works in single precision: the log then holds exactly what acted.
        return volts.astype(np.float32).astype(np.float64)

    def _move_robot(self, start: int, end: int, torque: np.ndarray, look: Callable) -> np.ndarray:
        """Let the robot follow over the exchange, with a row of the log where one is due; the mean torque."""
        lead = self.speeds if self.plan.coupling == "closed" else given(self.references, "references")
        wheels = self.path.wheels(lead[start + 1 : end + 1], torque)
        total, now = np.zeros(2), start
        while now < end:
            stop = min(end, (now // self.plan.log_steps + 1) * self.plan.log_steps)
            total += (stop - now) * self.engine.advance(wheels[now - start : stop - start])
            self.angles = self.angles + 0.5 * STEP_S * (self.speeds[now:stop] + self.speeds[now + 1 : stop + 1]).sum(
                axis=0
            )
            now = stop
            if now < end:
                look(now)
        return total / (end - start)

    def _move_together(
        self, coupler: Coupler, start: int, end: int, volts: np.ndarray, look: Callable
    ) -> list[np.ndarray]:
        """Motors and robot without lag, engine step by engine step; the torques (2,) that were sent to the shafts."""
        sent = []
        for step in range(start + 1, end + 1):
            motion = coupler.advance([(volts, STEP_S)])
            sent.append(coupler.sent)
            width = np.diff(motion.t_s, prepend=0.0)[:, None]
            speeds = np.vstack([self.speeds[step - 1], motion.speeds])
            turned = (0.5 * width * (speeds[1:] + speeds[:-1])).sum(axis=0)
            self.speeds[step], self.currents[step] = motion.speeds[-1], motion.currents[-1]
            if self.behind.any():
                self.seen[step] = np.where(self.behind, coupler.state[:, layer.WHEEL], motion.speeds[-1])
                wheels = 0.5 * STEP_S * (self.seen[step - 1] + self.seen[step])
                turned = np.where(self.behind, wheels, turned)
            self.angles = self.angles + turned
            if self.path.watches:
                self.path.watch(self.t[step], self._sample(step))
            if step < end and step % self.plan.log_steps == 0:
                look(step)
        return sent

    def _note_played(self, commanded: np.ndarray) -> None:
        """Put the mean of played voltages where they took the place of commands (n, 2), a row of the log at a time."""
        if self.injection is None or self.injection.stimulus is None:
            return
        per = round(STEP_S / self.injection.step_s)
        for start in range(0, len(commanded), self.plan.log_steps):
            end = min(start + self.plan.log_steps, len(commanded))
            mean = self.injection.played_mean(start * per, end * per)
            commanded[start:end] = np.where(np.isnan(mean), commanded[start:end], mean)

    def _bus(self, step: int) -> float:
        """Voltage of the supply."""
        nominal = self.plan.robot.supply_v
        if self.correction is None or self.coupler is None:
            return nominal
        supply = self.correction.supply
        draw = float(self.currents[step] @ self.coupler.in_force) / nominal
        return nominal - supply.source_resistance_ohm * draw - supply.decline_v_per_s * float(self.t[step])

    def _sample(self, step: int) -> Sample:
        state = self.engine.state()
        return Sample(
            v_bus=self._bus(step),
            currents_a=self.currents[step],
            speeds_rad_s=self.seen[step],
            angles_rad=self.angles,
            gyro_rad_s=state.yaw_rate_rad_s,
            x_m=state.x_m,
            y_m=state.y_m,
            yaw_rad=state.yaw_rad,
        )
