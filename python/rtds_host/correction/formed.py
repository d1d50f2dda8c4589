"""Forms that no table of a motor unit holds, in the simulator: between motor units and engine, and in the sensors.

The equations are the replay's (`rtds_host.plant.forms.act`), taken once an exchange in its middle. Torques load the
motors, forces on the body load the wheels, dry friction against turning joins the scrub. A voltage is sent as the
command whose bridge voltage is larger by it, and so is what a change of the torque constant takes off the back-EMF.
So is the voltage of a bridge in fast decay, which follows the back-EMF.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import Robot
from rtds_host.correction import layer
from rtds_host.correction.correction import Correction
from rtds_host.errors import InputError
from rtds_host.motor.effects import Curve, MotorParameters
from rtds_host.plant import forms
from rtds_host.robot import Body

_CODE = forms.TERM_CODE
# Terms of sensors, and the value of its own that each runs over.
READINGS = {"current_sensor": "i", "speed_sensor": "w", "gyro_sensor": "yaw_rate"}
_ABOUT = {name: k for k, name in enumerate(forms.OVERS)}


@dataclass(frozen=True)
class Acting:
    """What forms come to in an exchange: `drive` (2,) N·m at the wheels, forwards; `volts` (2,) V behind the driver at
    the nominal bus; `against` (2,) N·m that loads the wheels for forces on the body; `scrub` N·m against turning."""

    drive: np.ndarray
    volts: np.ndarray
    against: np.ndarray
    scrub: float


NOTHING = Acting(np.zeros(2), np.zeros(2), np.zeros(2), 0.0)


class Formed:
    """The forms and bridges of a correction along a run; it follows the wheels' angles by `turn`.

    `any`: whether there is one at all.
    """

    def __init__(self, robot: Robot, body: Body, correction: Correction | None):
        rows = forms.no_forms() if correction is None else np.array(correction.forms)
        self.bridges = (None, None) if correction is None else correction.bridges
        self.any = bool(forms.any_of(rows)) or any(self.bridges)
        self.gear, self.constant = robot.motor.gear_ratio, np.zeros(2)
        self.radius, self.track = np.array(body.wheel_radius_m), body.track_width_m
        self.lever = np.array([-self.radius[0], self.radius[1]]) / self.track
        self.angles = np.array(correction.start_angles if correction else (0.0, 0.0), dtype=float)
        self.delay_s = correction.supply.command_delay_s if correction else 0.0
        if not self.any or correction is None:
            return
        # A voltage acts when its command does, all else now. One along the command is known as it is asked.
        volts = rows[:, :, forms.TERM] == _CODE["voltage"]
        along = np.isin(rows[:, :, forms.OVER], [forms.OVER_CODE[over] for over in ("command_history", "heat")])
        self.by_command, self.late, self.prompt = rows.copy(), rows.copy(), rows.copy()
        self.by_command[~(volts & along)] = 0.0
        self.late[~volts | along] = 0.0
        self.prompt[volts] = 0.0
        # What a side remembers of commands as they are asked, and of those in force; heats are the same in both.
        self.asked, self.past, self.rows = np.zeros((2, forms.PAST)), np.zeros((2, forms.PAST)), rows
        # What runs over the current follows it through an exchange, in which it settles.
        self.settles = bool((self.prompt[:, :, forms.OVER] == forms.OVER_CODE["i"]).any())
        self.inverse: list[tuple[np.ndarray, np.ndarray] | None] = [None, None]
        for k in (0, 1):
            if self.bridges[k] or (volts[k] | (rows[k, :, forms.TERM] == _CODE["torque_constant"])).any():
                self.inverse[k] = _inverse(correction.units[k].command, robot.name)

    def at(
        self,
        now: float,
        seconds: float,
        rotor: np.ndarray,
        state: np.ndarray,
        currents: np.ndarray,
        speeds: np.ndarray,
        asked: np.ndarray,
        place: tuple[float, float, float],
    ) -> Acting:
        """What acts over the coming exchange.

        Parameters
        ----------
        now, seconds : s, its start and length. rotor, state : as of `layer.integrate`, at its start. currents : (n, 2)
        A and speeds : (n, 2) rad/s, of the rotors, as expected over it, means of n equal parts. asked : (2,) V,
        commands in force. place : x m, y m, yaw rad.
        """
        if not self.any:
            return NOTHING
        ground = state[:, layer.GROUND]
        about = np.zeros(forms.ABOUT)
        rate, speed = float(self.lever @ ground), 0.5 * float(self.radius @ ground)
        about[_ABOUT["yaw_rate"]], about[_ABOUT["speed"]], about[_ABOUT["speed_yaw_rate"]] = rate, speed, speed * rate
        about[_ABOUT["x"]], about[_ABOUT["y"]], about[_ABOUT["yaw"]] = place
        acts, part, late = np.zeros((2, forms.ACTS)), np.zeros(forms.ACTS), np.zeros(forms.ACTS)
        mean, drive = currents.mean(axis=0), np.zeros(2)
        emf = np.zeros(2)
        if not self.settles:
            currents, speeds = mean[None, :], speeds.mean(axis=0)[None, :]
        for k in (0, 1):
            forms.follow(self.prompt[k], asked[k], self.past[k])
            about[_ABOUT["v_cmd"]], about[_ABOUT["i"]] = asked[k], mean[k]
            about[_ABOUT["command_history"]] = self.past[k, forms.DIRECTION] * abs(asked[k])
            about[_ABOUT["load"]] = self.past[k, forms.GEAR_LOAD]
            about[_ABOUT["w"]] = state[k, layer.ROTOR]
            angle = self.angles[k] + 0.5 * seconds * state[k, layer.WHEEL]
            about[_ABOUT["th"]], about[_ABOUT["motor_angle"]] = angle, self.gear * angle
            about[_ABOUT["t"]] = now + 0.5 * seconds
            for current, turns in zip(currents[:, k], speeds[:, k], strict=True):
                about[forms.MEAN_I] = current
                forms.act(self.prompt[k], about, self.past[k], part)
                acts[k] += part / len(currents)
                drive[k] += rotor[k, layer.KM] * part[forms.CONSTANT] * current / len(currents)
                drive[k] -= part[forms.FLUID] * turns / len(currents)
                emf[k] += forms.back_emf(part, rotor[k, layer.KB], turns) / len(currents)
            about[_ABOUT["t"]] += self.delay_s
            forms.act(self.late[k], about, self.past[k], late)
            acts[k, forms.VOLTS] = late[forms.VOLTS] + emf[k]
            if (bridge := self.bridges[k]) is not None:
                # By the nominal back EMF: what a form of the torque constant takes off it is sent next to this.
                acts[k, forms.VOLTS] += bridge.more(asked[k], rotor[k, layer.KB] * float(speeds[:, k].mean()))
            drive[k] += acts[k, forms.DRIVE] - _friction_torque(
                acts[k], rotor[k, layer.INERTIA], state[k, layer.ROTOR], seconds
            )
        push, turn = acts[0, forms.PUSH], acts[0, forms.TURN]
        against = -(0.5 * self.radius * push + self.lever * turn)
        return Acting(drive, acts[:, forms.VOLTS], against, float(acts[0, forms.SCRUB]))

    def command_volts(self, asked: np.ndarray) -> np.ndarray:
        """What a command that is asked for adds by its history and by the heat, (2,) V at the nominal bus; asked : (2,)
        V, clipped."""
        more = np.zeros(2)
        if not self.any:
            return more
        about, acts = np.zeros(forms.ABOUT), np.zeros(forms.ACTS)
        for k in (0, 1):
            forms.follow(self.by_command[k], asked[k], self.asked[k])
            about[_ABOUT["v_cmd"]] = asked[k]
            about[_ABOUT["command_history"]] = self.asked[k, forms.DIRECTION] * abs(asked[k])
            forms.act(self.by_command[k], about, self.asked[k], acts)
            more[k] = acts[forms.VOLTS]
        return more

    def remember(self, delivered: np.ndarray, currents: np.ndarray, seconds: float) -> None:
        """Follow loads and heats: delivered : (2,) N·m, by the gears, and currents : (2,) A, both in the mean of the
        exchange before."""
        for k in (0, 1):
            forms.remember(self.rows[k], delivered[k], currents[k], seconds, self.past[k])
        self.asked[:, forms.HEATS :] = self.past[:, forms.HEATS :]

    def sent(self, volts: np.ndarray, more: np.ndarray) -> np.ndarray:
        """Commands (2,) V whose bridge voltages exceed those of `volts` by `more`, V at the nominal bus."""
        out = np.array(volts, dtype=float)
        for k, inverse in enumerate(self.inverse):
            if inverse is not None and more[k] != 0.0:
                asked, made = inverse
                out[k] = np.interp(np.interp(out[k], asked, made) + more[k], made, asked)
        return out

    def turn(self, width: np.ndarray, speeds: np.ndarray) -> None:
        """Follow the wheels: width (n, 1) s, speeds (n + 1, 2) rad/s."""
        self.angles = self.angles + (0.5 * width * (speeds[1:] + speeds[:-1])).sum(axis=0)


def _friction_torque(acts: np.ndarray, inertia: float, speed: float, seconds: float) -> float:
    """Torque, N·m, by which dry friction over the load acts against a rotor's speed, rad/s, over an exchange.

    It has no table of a unit, which could hold the wheel: it is at most what would stop the rotor alone.
    """
    level = acts[forms.FORWARD] if speed > 0.0 else acts[forms.BACKWARD]
    return float(np.sign(speed)) * min(float(level), inertia * abs(speed) / seconds)


def currents_over(
    rotor: np.ndarray, current: np.ndarray, volts: np.ndarray, speeds: np.ndarray, seconds: float
) -> np.ndarray:
    """Mean currents (n, 2) A of n steps of an exchange, by the armature's equation at the speed of each.

    current : (2,) A at its start; volts : (n, 2) V; speeds : (n, 2) rad/s; seconds : s, of a step.
    """
    settled = (volts - rotor[:, layer.KB] * speeds) / rotor[:, layer.RESISTANCE]
    tau = np.maximum(rotor[:, layer.INDUCTANCE] / rotor[:, layer.RESISTANCE] / seconds, 1e-9)
    fades = np.exp(-1.0 / tau)
    found = np.empty_like(settled)
    for n, end in enumerate(settled):
        found[n] = end + (current - end) * tau * (1.0 - fades)
        current = end + (current - end) * fades
    return found


def _inverse(command: Curve | None, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Points of a driver's curve, asked and made, V, made ascending.

    Raises
    ------
    InputError : a curve that falls somewhere: no command makes such voltages.
    """
    if command is None:
        raise LookupError("a voltage form needs the driver's curve in its unit")
    x, y = np.array(command.x), np.array(command.y)
    if (np.diff(y) < 0.0).any():
        raise InputError(
            f"robot {name!r}: forms: a voltage over more than the command needs a driver whose voltage grows with it"
        )
    return x, y


def drives_itself(rows: np.ndarray, motor: MotorParameters, gear: float) -> bool:
    """Whether the viscous friction of a side with its forms (MOST_FORMS, WIDTH) is negative at all points of their
    curves, and outweighs what its back-EMF brakes: at any voltage the motor then gets faster without end."""
    most = sum(float(forms.values_in(row).max()) for row in rows if row[forms.TERM] == _CODE["damping"])
    brakes = motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad / motor.resistance_ohm
    return bool(most + gear**2 * (motor.viscous_friction_nm_s_per_rad + brakes) < 0.0)


def needs_command(rows: np.ndarray, supply: float) -> float:
    """The largest voltage, V, by which forms of a side (MOST_FORMS, WIDTH) move a command beyond the supply, V; 0 for
    none. A back-EMF is at most about the supply, and a voltage over the heat is a share of the command."""
    sizes = np.abs(rows[:, forms.VALUES :]).max(axis=1)
    volts, constant = (rows[:, forms.TERM] == _CODE[name] for name in ("voltage", "torque_constant"))
    shares = volts & (rows[:, forms.OVER] == forms.OVER_CODE["heat"])
    return float(np.max(sizes * np.where(constant | shares, supply, volts)))


def beyond(command: Curve | None, supply: float, more: float) -> Curve:
    """A driver's curve that goes on by `more` V beyond the supply, V, on both sides."""
    plain = command or Curve((-supply, supply), (-supply, supply))
    end, top = plain.at(-supply), plain.at(supply)
    inside = [(x, y) for x, y in zip(plain.x, plain.y, strict=True) if abs(x) < supply]
    points = [(-supply - more, end - more), (-supply, end), *inside, (supply, top), (supply + more, top + more)]
    x, y = zip(*points, strict=True)
    return Curve(x, y)


def read_with_forms(
    rows: np.ndarray, currents: np.ndarray, speeds: np.ndarray, rate: float, elapsed: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Readings with the forms of their sensors: currents (2,) A, speeds (2,) rad/s, yaw rate rad/s; elapsed : s since
    the run began, of what is read."""
    if not forms.any_of(rows):
        return currents, speeds, rate
    codes = {term: (_CODE[term], forms.OVER_CODE[over]) for term, over in READINGS.items()}
    amps = np.array([a + forms.reads(rows[k], *codes["current_sensor"], a) for k, a in enumerate(currents)])
    turns = np.array([w + forms.reads(rows[k], *codes["speed_sensor"], w) for k, w in enumerate(speeds)])
    return amps, turns, rate + forms.turns_read(rows[0], rate, elapsed)


def with_forms(rows: np.ndarray, out: np.ndarray, elapsed: np.ndarray) -> None:
    """Add to readings (n, 11), columns as the replay's `OUTPUTS`, what forms of sensors do, in place; elapsed : (n,) s
    since the run began, of what is read."""
    if not forms.any_of(rows):
        return
    for row, when in zip(out, elapsed, strict=True):
        row[1:3], row[3:5], row[7] = read_with_forms(rows, row[1:3], row[3:5], float(row[7]), float(when))


def angle_of(over: str, gear: float) -> float:
    """Cycles a turn of the wheel of a quantity that repeats; 0 of others."""
    return {"th": 1.0, "motor_angle": gear}.get(over, 0.0)


def period_table(row: np.ndarray, gear: float) -> Curve:
    """One period of a form over an angle as a unit's table: N·m at the shaft over rad."""
    x = 2.0 * math.pi * np.arange(forms.POINTS + 1) / forms.POINTS
    values = np.append(forms.values_in(row), row[forms.VALUES]) / gear
    return Curve(tuple(x), tuple(values))
