"""Motors in a link and a robot in an engine, exchanged each millisecond without the lag of an exchange."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Motor, Robot
from rtds_host.correction import layer
from rtds_host.correction.correction import Correction
from rtds_host.correction.formed import NOTHING, Acting, Formed, currents_over
from rtds_host.errors import InputError
from rtds_host.link import Link
from rtds_host.motor.effects import MotorParameters, UnitEffects
from rtds_host.robot import STEP_S, Body, Engine
from rtds_host.robot.split import wheel_inertia
from rtds_host.robot.urdf import yaw_inertia_kg_m2

# Step of the layer between motor and engine, and between two looks at the motors.
LAYER_S = 1e-4
_PREDICTED = np.full(2, layer.PREDICTED)
# Of the no-load speed: no wheel on the ground gets there.
RUNAWAY = 10.0
# A voltage held over part of an exchange.
Piece = tuple[np.ndarray, float]


@dataclass(frozen=True)
class Motion:
    """What the motors did over one exchange: times s from its start (n,), speeds (n, 2) rad/s at the wheel's side of
    the gear, currents (n, 2) A. The last row is the end."""

    t_s: np.ndarray
    speeds: np.ndarray
    currents: np.ndarray


def set_effects(link: Link, correction: Correction) -> None:
    """Give a link a correction's effects.

    Raises
    ------
    InputError : the link has no effect unit, or it cannot hold them. LinkError : no answer.
    """
    effects = correction.links_effects()
    if all(part is None for part in effects.values()):
        return
    if not hasattr(link, "set_effects"):
        raise InputError("link: has no effect unit; effects in motor, driver or gear need the link model or rtl")
    link.set_effects(**effects)


class Coupler:
    """Lets motors and robot go on together, one exchange of torques after the other.

    Parameters
    ----------
    robot, body : nominal motors; body as the engine has it.
    link, engine : parameters and effects set, robot at rest.
    correction : what differs from the nominal robot; None: nothing.
    exchange_steps : engine steps between two exchanges of torques.
    predict : give the motors the torque of the coming exchange, predicted; without it, that of the one before.
    reflected_kg_m2 : without a correction, the inertia at each wheel that the link's motors carry for the body next to
        their rotor (`rtds_host.robot.split`); a correction says so itself.

    `reflected` (2,) kg m²: what they carry. `acceleration` (2,) rad/s²: of the rotors, mean over the last
    exchange. `sent` (2,) float32 N m at the shaft: torques of the last exchange; `load` (2,) N m: what the wheels took.
    `in_force` (2,) V: commands that act at its end, `now` s. `after_step` is called after each engine step.
    """

    def __init__(
        self,
        robot: Robot,
        body: Body,
        link: Link,
        engine: Engine,
        correction: Correction | None = None,
        exchange_steps: int = 1,
        predict: bool = True,
        reflected_kg_m2: float = 0.0,
    ):
        self.link, self.engine = link, engine
        self.exchange_steps, self.predict = exchange_steps, predict
        self.gear = robot.motor.gear_ratio
        self.supply_v = robot.supply_v
        gears = correction.gears if correction else (None, None)
        units = correction.units if correction else (UnitEffects(), UnitEffects())
        self.units = units
        self.delay_s = correction.supply.command_delay_s if correction else 0.0
        self.scrub = correction.scrub_nm if correction else 0.0
        self.side = np.zeros((2, 8))
        self.grip = np.ones(2)
        for k, gear in enumerate(gears):
            if gear is not None:
                *constants, grip = astuple(gear)
                self.side[k, : layer.RADIUS] = constants
                self.grip[k] = grip * 0.5 * body.total_mass_kg * GRAVITY_M_S2 * body.wheel_radius_m[k]
            self.side[k, layer.RADIUS] = body.wheel_radius_m[k]
        self.wheel_j = body.wheel_inertia_kg_m2
        # The engine's, and the robot's, where the engine could not build it (`BodyValues.on`).
        self.inertia, self.lever = wheel_inertia(body, yaw_inertia_kg_m2(body))
        wanted = correction.body.yaw_inertia_kg_m2 if correction else yaw_inertia_kg_m2(body)
        if wanted <= body.total_mass_kg * body.com_m[1] ** 2:
            raise InputError(
                f"com_y_m: {body.com_m[1]:g} m off the axle's mid-point needs more yaw inertia than {wanted:g} kg m2"
            )
        self.ground = np.linalg.inv(wheel_inertia(body, wanted)[0])
        self.rotor = np.array([self._rotor(robot, unit) for unit in units])
        self.reflected = np.full(2, reflected_kg_m2)
        for k, motor in enumerate(correction.loaded_motors if correction else ()):
            own = self.rotor[k, layer.INERTIA]
            self.reflected[k] = 0.0 if motor is None else self.gear**2 * motor.rotor_inertia_kg_m2 - own
        self.acceleration = np.zeros(2)
        self.runaway = RUNAWAY * robot.supply_v / (self.gear * robot.motor.back_emf_constant_v_s_per_rad)
        self.state = np.zeros((2, 6))
        self.contact = layer.start_contact(self.side)
        self.elastic = (self.side[:, layer.STIFFNESS] > 0.0) | (self.side[:, layer.BACKLASH] > 0.0)
        self.current, self.speed, self.mean_current = np.zeros(2), np.zeros(2), np.zeros(2)
        self.known = np.full(2, layer.GIVEN)
        self.offset_v = np.zeros(2)
        self.disturbance = np.zeros(2)
        self.external = engine.hold()
        self.shortfall = np.zeros(2)
        self.load = self.external.copy()
        self.sent = np.zeros(2, np.float32)
        self.after_step: Callable[[], None] | None = None
        self.now = 0.0
        self.formed, self.acting = Formed(robot, body, correction), NOTHING
        self.in_force = np.zeros(2)
        # Commands, when they were given, and the voltages that they make; before the first none.
        self._past: list[tuple[float, np.ndarray, np.ndarray]] = [(-np.inf, np.zeros(2), np.zeros(2))]

    def _rotor(self, robot: Robot, unit: UnitEffects) -> list[float]:
        m: MotorParameters | Motor = unit.motor or robot.motor
        n = self.gear
        levels = [
            n * max(curve.at(0.0), 0.0) if curve is not None else 0.0
            for curve in (unit.friction_forward, unit.friction_backward)
        ]
        return [
            n * n * m.rotor_inertia_kg_m2,
            n * n * m.viscous_friction_nm_s_per_rad,
            n * m.torque_constant_nm_per_a,
            n * m.back_emf_constant_v_s_per_rad,
            m.resistance_ohm,
            m.inductance_h,
            *levels,
        ]

    def _bridge(self, volts: np.ndarray) -> np.ndarray:
        """Voltages (2,) at the nominal bus, of those asked for, as far as they are known."""
        out = np.array(volts, dtype=float)
        for k, unit in enumerate(self.units):
            if unit.command is not None:
                out[k] = unit.command.at(out[k])
            out[k] = min(max(out[k], -unit.limit_v), unit.limit_v)
        return out

    def _schedule(self, pieces: list[Piece], by_command: list[np.ndarray]) -> np.ndarray:
        """Voltages (n, 2) at the motors for each step of the layer: those asked for, late by the command's delay.

        by_command : (2,) V that each piece adds by its history and the heat.
        """
        start = now = self.now
        for (volts, seconds), more in zip(pieces, by_command, strict=True):
            self._past.append((now, np.array(volts, dtype=float), self._bridge(volts) + more))
            now += seconds
        count = round((now - start) / LAYER_S)
        late = start - self.delay_s
        # Whatever is older than the oldest command that still counts.
        while len(self._past) > 1 and self._past[1][0] <= late + 1e-9:
            self._past.pop(0)
        times = [t for t, _, _ in self._past]
        values = np.array([made for _, _, made in self._past])
        index = np.searchsorted(times, late + (np.arange(count) + 0.5) * LAYER_S, side="right") - 1
        self.now = now
        self.in_force = self._past[max(int(np.searchsorted(times, now - self.delay_s - 1e-9, side="left")) - 1, 0)][1]
        return values[np.maximum(index, 0)]

    def advance(self, pieces: list[Piece]) -> Motion:
        """Go on by one exchange.

        Parameters
        ----------
        pieces : voltages (2,) V asked for, clipped at the supply, and how long each is held, s (whole simulator
            steps); together `exchange_steps` engine steps, or fewer at the end of a run.

        Raises
        ------
        InputError : wheels whose motors carry the body have lost the ground, and run away. LinkError : no answer.
        """
        total_s = sum(seconds for _, seconds in pieces)
        steps = round(total_s / STEP_S)
        start_s = self.now
        by_command = [self.formed.command_volts(asked) for asked, _ in pieces]
        volts = self._schedule(pieces, by_command)
        acting = self._acting(start_s, total_s, volts)
        if self.formed.any:
            volts = volts + acting.volts
            pieces = [
                (self.formed.sent(asked, acting.volts + more), seconds)
                for (asked, seconds), more in zip(pieces, by_command, strict=True)
            ]
        self.acting = acting
        scrub, outside = self.scrub + acting.scrub, self.external + acting.against
        if self.predict:
            known = np.clip(volts + self.offset_v, -1e4, 1e4)
            # A driven rotor is where it ought to be; a given one will be what the shortfall torque makes of it.
            brake = self.disturbance - acting.drive + np.where(self.known == layer.DRIVEN, 0.0, self.shortfall)
            state = self.state.copy()
            # A given rotor's speed is known to rounding. One that friction holds must be exactly at rest, or the
            # shortfall is counted as moving a rotor that is light compared with the body.
            state[(self.reflected > 0.0) & (self.speed == 0.0), layer.ROTOR] = 0.0
            torque, spin = self._integrate(
                _PREDICTED, known, known, brake, state, self.contact.copy(), scrub, 0.0, outside
            )
            load = torque + self.shortfall
            expected = (state[:, layer.ROTOR] - self.speed) / total_s
        else:
            torque, load, expected = self.load, self.load, self.acceleration
            rate = float(self.lever @ self.state[:, layer.GROUND])
            spin = max(-1.0, min(1.0, rate / 0.02))
        if self.reflected.any():
            load = load - self.reflected * expected
        sent = ((load - acting.drive) / self.gear).astype(np.float32)
        self.sent = sent
        before = self.speed
        motion = self._exchange(pieces, sent)
        acted = sent.astype(float) * self.gear
        self.acceleration = (motion.speeds[-1] - before) / total_s
        if self.reflected.any():
            if np.abs(motion.speeds[-1]).max() > self.runaway:
                raise InputError(
                    f"the wheels have lost the ground at {self.now:.3f} s: so hard a start, or stop, lifts the robot"
                    " off its wheels; ask for less voltage at once"
                )
            acted = acted + self.reflected * self.acceleration
        self._observe(motion, volts, acted, total_s)
        happened = self._follow(motion, steps, spin, acted + acting.drive, scrub)
        if self.predict:
            behind = self.rotor[:, layer.INERTIA] * (self.speed - self.state[:, layer.ROTOR]) / total_s
            predicted = torque + self.reflected * (self.acceleration - expected) if self.reflected.any() else torque
            self.shortfall = np.where(self.known == layer.DRIVEN, behind, happened - predicted)
        self.load = happened
        if self.formed.any:
            self.formed.remember(happened, self.mean_current, total_s)
        return motion

    def _acting(self, start_s: float, seconds: float, volts: np.ndarray) -> Acting:
        """What forms come to over an exchange that begins at `start_s` s; volts : (n, 2) V of its layer steps."""
        if not self.formed.any:
            return NOTHING
        # Forms of the exchange before drive the current, too.
        known = volts + self.offset_v + self.acting.volts
        h = seconds / len(volts)
        speeds = self.speed + (np.arange(len(volts))[:, None] + 0.5) * h * self.acceleration
        amps = currents_over(self.rotor, self.current, known, speeds, h)
        pose = self.engine.state()
        place = pose.x_m, pose.y_m, pose.yaw_rad
        return self.formed.at(start_s, seconds, self.rotor, self.state, amps, speeds, self.in_force, place)

    def load_of(self, acceleration: np.ndarray) -> np.ndarray:
        """Torques (2,) N m that the wheels take at an `acceleration` (2,) rad/s² behind a rigid gear."""
        return self.external + self.acting.against + self.inertia @ acceleration + self.wheel_j * acceleration

    def _integrate(
        self,
        known: np.ndarray,
        given: np.ndarray,
        volts: np.ndarray,
        brake: np.ndarray,
        state: np.ndarray,
        contact: np.ndarray,
        scrub: float,
        spin: float,
        outside: np.ndarray,
    ) -> tuple[np.ndarray, float]:
        """`layer.integrate` with this robot: changes `state` and `contact`."""
        moving = self.rotor, self.current, volts, brake, state, contact, self.side
        fixed = self.wheel_j, self.ground, self.lever
        return layer.integrate(LAYER_S, known, given, *moving, *fixed, scrub, spin, self.grip, outside)

    def _exchange(self, pieces: list[Piece], sent: np.ndarray) -> Motion:
        times, speeds, currents = [], [], []
        now = 0.0
        for volts, seconds in pieces:
            got = self.link.exchange(np.asarray(volts, dtype=np.float32), sent, seconds, min(LAYER_S, seconds))
            times.append(now + got.t_s)
            speeds.append(got.speeds)
            currents.append(got.currents)
            now += seconds
        return Motion(
            np.concatenate(times),
            np.concatenate(speeds).astype(float) / self.gear,
            np.concatenate(currents).astype(float),
        )

    def _observe(self, motion: Motion, volts: np.ndarray, load: np.ndarray, seconds: float) -> None:
        """Learn from an exchange what the motors have beyond their constants: a voltage, and a torque that brakes."""
        t = np.concatenate([[0.0], motion.t_s])
        before = self.speed
        current = np.vstack([self.current, motion.currents])
        speed = np.vstack([before, motion.speeds])
        width = np.diff(t)[:, None]
        mean_i = (0.5 * (current[1:] + current[:-1]) * width).sum(axis=0) / seconds
        mean_w = (0.5 * (speed[1:] + speed[:-1]) * width).sum(axis=0) / seconds
        rotor = self.rotor
        seen = (
            rotor[:, layer.RESISTANCE] * mean_i
            + rotor[:, layer.KB] * mean_w
            + rotor[:, layer.INDUCTANCE] * (current[-1] - current[0]) / seconds
        )
        self.offset_v = seen - volts.mean(axis=0)
        self.disturbance = (
            rotor[:, layer.KM] * mean_i
            - rotor[:, layer.VISCOUS] * mean_w
            - load
            - rotor[:, layer.INERTIA] * (speed[-1] - speed[0]) / seconds
        )
        self.current, self.mean_current = current[-1].copy(), mean_i

    def _follow(self, motion: Motion, steps: int, spin: float, sent: np.ndarray, scrub: float) -> np.ndarray:
        """Let gear, wheels and robot follow the rotors; the mean torque (2,) that the gears delivered.

        sent : (2,) N m that the gears took off the rotors. scrub : N m against turning.
        """
        per = round(STEP_S / LAYER_S)
        at = (np.arange(steps * per) + 1) * LAYER_S
        before, end = self.speed, motion.speeds[-1]
        if len(motion.t_s) == len(at) and np.allclose(motion.t_s, at, rtol=0, atol=1e-9):
            given = motion.speeds.copy()
        else:
            t = np.concatenate([[0.0], motion.t_s])
            given = np.column_stack(
                [np.interp(at, t, np.concatenate([[before[k]], motion.speeds[:, k]])) for k in range(2)]
            )
        for k in range(2):
            # A rotor that dry friction holds takes any blow without moving.
            held = before[k] == 0.0 and end[k] == 0.0
            self.known[k] = layer.DRIVEN if self.elastic[k] and not held and self.predict else layer.GIVEN
            if self.known[k] == layer.DRIVEN:
                gained = np.diff(given[:, k], prepend=before[k])
                given[:, k] = self.rotor[k, layer.INERTIA] * gained + LAYER_S * sent[k]
        if self.formed.any:
            t = np.concatenate([[0.0], motion.t_s])
            self.formed.turn(np.diff(t)[:, None], np.vstack([before, motion.speeds]))
        self.speed = end.copy()
        total, no_volts = np.zeros(2), np.zeros((per, 2))
        for k in range(steps):
            before = self.state[:, layer.GROUND].copy()
            rows, outside = given[k * per : (k + 1) * per], self.external + self.acting.against
            torque, _ = self._integrate(
                self.known, rows, no_volts, self.disturbance, self.state, self.contact, scrub, spin, outside
            )
            now = self.state[:, layer.GROUND]
            answer = self.engine.advance(now[None, :])
            rate = (now - before) / STEP_S
            external = answer - self.inertia @ rate - self.wheel_j * rate
            total += torque + external - self.external
            self.external = external
            if self.after_step is not None:
                self.after_step()
        return total / steps
