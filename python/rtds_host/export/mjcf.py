"""MJCF: a free robot on a plane whose wheels are driven by volts.

`ctrl` is the commanded voltage of a motor, also behind a servo, whose loop is in the file as numbers. The
actuator's force is its current: with gear N·Km the joint feels N·Km·i and the actuator sees the speed N·Km·w, so that
gain 1/R and bias -Kb/(R·Km) make it i = (V - N·Kb·w)/R (the inductance left out: its time constant is a fraction of the
step). Elements and their meaning: MuJoCo, XML Reference (mujoco.readthedocs.io).
"""

from __future__ import annotations

import inspect
import math
from dataclasses import replace
from xml.sax.saxutils import quoteattr

from rtds_host.correction.formed import needs_command
from rtds_host.diagnosis.forms.curves import named
from rtds_host.export import dcmotor, mjcf_driver, mjcf_forms
from rtds_host.export.figures import SIDES, Figures, Side
from rtds_host.export.python import alone, form_constants, source_of
from rtds_host.export.table import LEFT_OUT, OWN, How
from rtds_host.plant import forms
from rtds_host.robot.body import SKID_RADIUS_M
from rtds_host.robot.urdf import base_inertia, supports

TIMESTEP_S = 5e-4
# What a wheel's motor is written as: `general` gives its current from the voltage at once, `dcmotor` has a winding.
ACTUATORS = ("general", "dcmotor")
# A body without mass does not exist in MuJoCo; this much is negligible next to any robot.
NO_MASS_KG = 1e-6
# Friction and limits of joints as hard as the step allows.
FIRM = 'solreffriction="0.001 1" solimpfriction="0.9999 0.9999 0.001"'
CONTACT = 'solref="0.002 1" solimp="0.9999 0.9999 0.001"'


def vector(*values: float) -> str:
    """Numbers for an attribute."""
    return " ".join(f"{value:.9g}" for value in values)


def timestep_s(actuator: str) -> float:
    """Step of a file, s."""
    return dcmotor.TIMESTEP_S if actuator == "dcmotor" else TIMESTEP_S


def _delay_attributes(delay_s: float, step_s: float = TIMESTEP_S) -> str:
    """Attributes of an actuator or a sensor with a delay."""
    if delay_s <= 0.0:
        return ""
    return f' nsample="{math.ceil(delay_s / step_s) + 2}" interp="linear" delay="{delay_s:.9g}"'


def heats(side: Side) -> bool:
    """Whether a winding's heat can be told MuJoCo's motor: it has one constant for torque and voltage, and no driver's
    gain.
    """
    same = math.isclose(side.gear_nm_per_a, side.back_emf_v_s_per_rad, rel_tol=1e-6)
    return side.heat_rise_per_w > 0.0 and same and side.voltage_gain == 1.0


def holds_asymmetry(side: Side) -> bool:
    """Whether friction that differs by direction is a torque next to dry friction: it is, as long as both keep their
    signs.
    """
    return abs(side.asymmetry_nm) <= side.dry_nm


def exceptions(figures: Figures, actuator: str = "general") -> dict[str, How]:
    """What MJCF has in general and has not, or not wholly, for these numbers and this `actuator`, by the parameter of
    the plant."""
    found: dict[str, How] = {}
    for name, side in zip(SIDES, figures.sides, strict=True):
        if actuator == "general" and side.heat_rise_per_w > 0.0 and not heats(side):
            found["heat_rise"] = How(LEFT_OUT, f"{name}: MuJoCo's motor needs Km = Kb and a driver without a gain")
        if side.asymmetry_nm and not holds_asymmetry(side):
            found["asymmetry"] = How(LEFT_OUT, f"{name}: larger than the dry friction of that side")
        elif actuator == "general" and side.asymmetry_nm_s_per_rad:
            found["asymmetry"] = How(OWN, f"actuator/general biasprm; {name}: its part by speed is left out")
        if side.backlash_rad and side.stiffness_nm_per_rad:
            found["backlash"] = How(LEFT_OUT, f"{name}: the hinge that would have it is the gear's spring")
    return found


def _by_speed(side: Side) -> float:
    """Friction by direction and speed, where its part by direction alone is in the file."""
    return side.asymmetry_nm_s_per_rad if holds_asymmetry(side) else 0.0


def _hinges(name: str, side: Side) -> str:
    """The wheel's hinge; before it the gear's, where that yields: its rotor turns by both angles less."""
    lugre = side.stribeck_nm != 0.0
    dry = 0.0 if lugre else side.dry_nm
    motor = (
        f'armature="{side.rotor_kg_m2:.9g}" damping="{side.viscous_nm_s_per_rad:.9g}" frictionloss="{dry:.9g}" {FIRM}'
    )
    if not (side.stiffness_nm_per_rad or side.backlash_rad):
        return f'        <joint name="wheel_{name}" type="hinge" axis="0 1 0" {motor}/>\n'
    yields = f'stiffness="{side.stiffness_nm_per_rad:.9g}" damping="{side.damping_nm_s_per_rad:.9g}"'
    if not side.stiffness_nm_per_rad:
        half = 0.5 * side.backlash_rad
        yields = f'range="{vector(-half, half)}" limited="true" solreflimit="0.001 1" solimplimit="0.9999 0.9999 0.001"'
    return (
        f'        <joint name="wheel_{name}" type="hinge" axis="0 1 0" {motor}/>\n'
        f'        <joint name="gear_{name}" type="hinge" axis="0 1 0" {yields}/>\n'
    )


def _wheel(figures: Figures, k: int) -> str:
    body, side, name = figures.body, figures.sides[k], SIDES[k]
    spin = body.wheel_inertia_kg_m2
    return (
        f'      <body name="wheel_{name}" pos="{vector(0.0, (0.5 - k) * body.track_width_m, side.radius_m)}">\n'
        f'        <inertial pos="0 0 0" mass="{body.wheel_mass_kg:.9g}" '
        f'diaginertia="{vector(spin / 2, spin, spin / 2)}"/>\n'
        f"{_hinges(name, side)}"
        f'        <geom name="wheel_{name}" type="sphere" size="{side.radius_m:.9g}" condim="3" '
        f'friction="{body.tyre_friction:g} 0 0" contype="2" conaffinity="1" {CONTACT}/>\n      </body>\n'
    )


def formed(figures: Figures, term: str, over: str | None = None) -> bool:
    """Whether a robot has a form of a term, and over this quantity."""
    names = [named(row) for row in figures.forms.reshape(-1, forms.WIDTH)]
    return any(name is not None and name[0] == term and over in (None, name[1]) for name in names)


def most_v(figures: Figures, k: int) -> float:
    """Largest control of a side, V: its limit, and what forms of its voltage and its back-EMF add to the supply."""
    side = figures.sides[k]
    if not (formed(figures, "voltage") or formed(figures, "torque_constant")) or side.voltage_gain == 0.0:
        return figures.limit_v(side)
    more = sum(needs_command(row[None], figures.supply_v) for row in figures.forms[k])
    gain = abs(side.voltage_gain)
    return min(figures.supply_v + more / gain, side.limit_v / gain)


def _motor(figures: Figures, k: int, actuator: str) -> str:
    side, name = figures.sides[k], SIDES[k]
    top = most_v(figures, k)
    # Behind a servo the speeds asked for are late, its voltages are not.
    delayed = 0.0 if figures.loop is not None else figures.command_delay_s
    if actuator == "dcmotor":
        motor = dcmotor.element(figures, side)
        motor = replace(motor, top_v=max(top, motor.top_v)) if side.voltage_gain else motor
        return dcmotor.text(name, _delay_attributes(delayed, dcmotor.TIMESTEP_S), motor)
    common = (
        f'name="motor_{name}" joint="wheel_{name}" gear="{side.gear_nm_per_a:.9g}" ctrllimited="true" '
        f'ctrlrange="{vector(-top, top)}"{_delay_attributes(delayed)}'
    )
    if heats(side):
        # Resistance by temperature, R (1 + a (T - T0)): with a = 1/K the temperature's rise is that of the resistance.
        return (
            f'    <dcmotor {common} motorconst="1 1" resistance="{side.resistance_ohm:.9g}" '
            f'thermal="{vector(side.heat_rise_per_w, 0.0, side.heat_tau_s, 1.0, 0.0, 0.0)}"/>\n'
        )
    back = side.back_emf_v_s_per_rad / (side.resistance_ohm * side.gear_nm_per_a)
    return (
        f'    <general {common} gaintype="fixed" gainprm="{side.voltage_gain / side.resistance_ohm:.9g}" '
        f'biastype="affine" biasprm="{vector(0.0, 0.0, -back)}"/>\n'
    )


def _passive(figures: Figures, k: int, actuator: str) -> str:
    """Torques that no command changes. They stand after the motors, which so are the first two controls."""
    side, name, text = figures.sides[k], SIDES[k], ""
    if side.asymmetry_nm and holds_asymmetry(side):
        text += (
            f'    <general name="asymmetry_{name}" joint="wheel_{name}" gaintype="fixed" gainprm="0" biastype="affine" '
            f'biasprm="{vector(-side.asymmetry_nm, 0.0, 0.0)}"/>\n'
        )
    passive = f'joint="wheel_{name}" input="none" motorconst="0 0" resistance="1"'
    second = dcmotor.second_harmonic(side)
    if second[0]:
        text += f'    <dcmotor name="ripple_second_{name}" {passive} cogging="{vector(*second)}"/>\n'
    if actuator == "dcmotor":
        return text
    if side.torques["ripple_nm"]:
        text += (
            f'    <dcmotor name="ripple_{name}" {passive} '
            f'cogging="{vector(*(side.torques[name] for name in dcmotor.COGGING))}"/>\n'
        )
    if side.stribeck_nm:
        level = side.dry_nm + side.stribeck_nm
        stiffest = (dcmotor.BRISTLE_SWING / TIMESTEP_S) ** 2 * (side.rotor_kg_m2 + figures.body.wheel_inertia_kg_m2)
        numbers = vector(min(level / dcmotor.BRISTLE_RAD, stiffest), 0.0, side.dry_nm, level, side.stribeck_rad_s)
        text += f'    <dcmotor name="friction_{name}" {passive} lugre="{numbers}"/>\n'
    return text


def _behind(figures: Figures, side: Side) -> bool:
    """Whether a side's encoder sits behind a hinge of its gear."""
    return bool(figures.encoder_at_wheel and (side.stiffness_nm_per_rad or side.backlash_rad))


def _scrub(figures: Figures) -> str:
    """Dry friction against turning: of a tendon whose length is the yaw angle of wheels that roll without slip."""
    if not (figures.scrub_nm or formed(figures, "yaw_torque", "yaw_rate")):
        return ""
    text = f'    <fixed name="scrub" frictionloss="{figures.scrub_nm:.9g}" {FIRM}>\n'
    for side, name, sign in zip(figures.sides, SIDES, (-1.0, 1.0), strict=True):
        arm = sign * side.radius_m / figures.body.track_width_m
        text += f'      <joint joint="wheel_{name}" coef="{arm:.9g}"/>\n'
        if side.stiffness_nm_per_rad or side.backlash_rad:
            text += f'      <joint joint="gear_{name}" coef="{arm:.9g}"/>\n'
    return text + "    </fixed>\n"


def _tendons(figures: Figures) -> str:
    """The angle of a wheel on two hinges as a sum of theirs, for an encoder on the wheel, and the scrub's; nothing
    without either.
    """
    text = _scrub(figures) + "".join(
        f'    <fixed name="wheel_{name}">\n      <joint joint="wheel_{name}" coef="1"/>\n'
        f'      <joint joint="gear_{name}" coef="1"/>\n    </fixed>\n'
        for side, name in zip(figures.sides, SIDES, strict=True)
        if _behind(figures, side)
    )
    return f"  <tendon>\n{text}  </tendon>\n" if text else ""


def _sensors(figures: Figures, actuator: str) -> str:
    step = timestep_s(actuator)
    delayed = _delay_attributes(figures.measurement_delay_s, step)
    # A <dcmotor>'s force is its torque, friction and cogging included; its current is an activation.
    force = "i" if actuator == "general" else "torque"

    def noise(key: str) -> str:
        return f' noise="{figures.noise[key]:.9g}"' if key in figures.noise else ""

    text = ""
    for side, name, letter in zip(figures.sides, SIDES, "lr", strict=True):
        speed_delayed = _delay_attributes(figures.measurement_delay_s + side.speed_delay_s, step)
        seen = "tendon" if _behind(figures, side) else "joint"
        text += (
            f'    <actuatorfrc name="{force}_{letter}" actuator="motor_{name}"'
            f"{noise('i_a') if force == 'i' else ''}{delayed}/>\n"
            f'    <{seen}vel name="w_{letter}" {seen}="wheel_{name}"{noise("w_rad_s")}{speed_delayed}/>\n'
            f'    <{seen}pos name="th_{letter}" {seen}="wheel_{name}"{noise("th_rad")}{delayed}/>\n'
        )
    return (
        text + f'    <gyro name="gyro" site="axle"{noise("gyro_rad_s")}{delayed}/>\n'
        f'    <framepos name="position" objtype="site" objname="axle"{noise("xy_m")}/>\n'
        f'    <framexaxis name="heading" objtype="site" objname="axle"{noise("yaw_rad")}/>\n'
    )


def _numbers(figures: Figures, actuator: str) -> dict[str, tuple[float, ...]]:
    """What is in the file for whoever feeds commands and reads sensors; only what differs from nothing, and the
    supply.
    """

    def both(name: str) -> tuple[float, ...]:
        return tuple(getattr(side, name) for side in figures.sides)

    drop, knee = both("drop_v"), both("drop_knee_a")
    there: dict[str, tuple[tuple[float, ...], float | None]] = {
        "drop_v": (drop, 0.0),
        "drop_knee_a": (knee, 0.0),
        "resistance_ohm": (both("resistance_ohm") if any(knee) else (0.0,), 0.0),
        "back_emf_v_s_per_rad": (both("back_emf_v_s_per_rad") if any(drop) else (0.0,), 0.0),
        "voltage_gain": (both("voltage_gain") if any(drop) else (1.0,), 1.0),
        "deadzone_v": (both("deadzone_v"), 0.0),
        "pwm_curve": (both("pwm_curve"), 0.0),
        "source_resistance_ohm": ((figures.source_resistance_ohm,), 0.0),
        "decline_v_per_s": ((figures.decline_v_per_s,), 0.0),
        "rolling_coefficient": ((figures.rolling,), 0.0),
        "slope_extra_rad": ((figures.slope_extra_rad,), 0.0),
        "speed_gain": (both("speed_gain"), 1.0),
        "speed_filter_s": (both("speed_filter_s"), 0.0),
        "current_gain": (both("current_gain"), 1.0),
        "current_bias_a": (both("current_bias_a"), 0.0),
        "gyro_gain": ((figures.gyro_gain,), 1.0),
        "gyro_bias_rad_s": ((figures.gyro_bias_rad_s,), 0.0),
    }
    if actuator == "dcmotor":
        motors = [dcmotor.element(figures, side) for side in figures.sides]
        there |= {
            "current_per_activation": (tuple(motor.current_per_activation for motor in motors), None),
            "current_delay_s": ((figures.measurement_delay_s,), 0.0),
            "load_share": (both("load_share"), 0.0),
            "stribeck_nm": (both("stribeck_nm"), 0.0),
            "stribeck_rad_s": (both("stribeck_rad_s") if any(both("stribeck_nm")) else (0.0,), 0.0),
            "dry_nm": (both("dry_nm"), None) if any(both("stribeck_nm") + both("load_share")) else ((0.0,), 0.0),
            "asymmetry_nm_s_per_rad": (tuple(_by_speed(side) for side in figures.sides), 0.0),
        }
    if figures.loop is not None:
        loop = figures.loop
        there |= {
            "servo_kp_v_s_per_rad": ((loop.kp_v_s_per_rad,), None),
            "servo_ki_v_per_rad": ((loop.ki_v_per_rad,), None),
            "servo_limit_v": ((loop.limit_v,), None),
            "servo_period_s": ((loop.period_s,), None),
            "command_delay_s": ((figures.command_delay_s,), 0.0),
            "command_gain": (both("command_gain"), 1.0),
        }
    if forms.any_of(figures.forms):
        there |= {
            "gear_ratio": ((figures.gear_ratio,), None),
            "winding_ohm": (both("resistance_ohm"), None),
            "torque_per_current_nm_per_a": (both("gear_nm_per_a"), None),
            "back_emf_v_s_per_rad": (both("back_emf_v_s_per_rad"), None),
        }
        for name, rows in zip(SIDES, figures.forms, strict=True):
            for n, row in enumerate(rows):
                if row[forms.TERM]:
                    there[f"form_{name}_{n + 1}"] = (tuple(float(v) for v in row), None)
    kept = {name: values for name, (values, nothing) in there.items() if any(value != nothing for value in values)}
    return {"supply_v": (figures.supply_v,), **kept}


def driver_source() -> str:
    """Source of the Python module that goes along with `dcmotor`; it reads its numbers from the file."""
    forms_class = inspect.getsource(mjcf_forms.Forms)
    return alone(mjcf_driver, "class Driver:", more=(*_form_sources(), forms_class))


def forms_source() -> str:
    """Source of the Python module that goes along with a file that has forms; it reads its numbers from the file."""
    called = forms.curve, forms.branch, forms.filtered_load, forms.warmed
    return alone(mjcf_forms, "class Forms:", called, (form_constants(),))


# What `Forms` uses.
LAWS_OF_FORMS = (
    *(forms.curve, forms.branch, forms.act, forms.back_emf, forms.follow, forms.filtered_load, forms.warmed),
    *(forms.remember, forms.reads, forms.turns_read),
)


def _form_sources() -> list[str]:
    """Source of what `Forms` uses."""
    return [form_constants(), *source_of(LAWS_OF_FORMS)]


def write(figures: Figures, comment: str, actuator: str = "general") -> str:
    """The robot as MJCF; `comment` is at its head, `actuator` is one of `ACTUATORS`."""
    body = figures.body
    base = base_inertia(body)
    height = 0.5 * sum(body.wheel_radius_m)
    skids = "".join(
        f'      <geom name="{name}" type="sphere" size="{SKID_RADIUS_M:g}" '
        f'pos="{vector(x, body.com_m[1], SKID_RADIUS_M)}" condim="1" contype="2" conaffinity="1" {CONTACT}/>\n'
        for name, x in supports(body)
    )
    numbers = "".join(
        f'    <numeric name="{name}" data="{vector(*values)}"/>\n'
        for name, values in _numbers(figures, actuator).items()
    )
    return (
        f'<?xml version="1.0"?>\n<!--\n{comment}-->\n<mujoco model={quoteattr(figures.name)}>\n'
        '  <compiler angle="radian" autolimits="true"/>\n'
        f'  <option timestep="{timestep_s(actuator):g}" gravity="{vector(*body.gravity_m_s2)}" '
        'integrator="implicitfast" cone="elliptic" solver="Newton" iterations="50" tolerance="1e-12" impratio="10"/>\n'
        f"  <custom>\n{numbers}  </custom>\n  <worldbody>\n"
        f'    <geom name="ground" type="plane" size="0 0 1" condim="1" '
        f'friction="{body.tyre_friction:g} 0 0" contype="1" '
        f'conaffinity="2" {CONTACT}/>\n'
        '    <body name="base">\n      <freejoint name="base"/>\n'
        f'      <inertial pos="{vector(*base.com_m)}" mass="{base.mass_kg:.9g}" '
        f'diaginertia="{vector(*base.inertia_kg_m2)}"/>\n'
        f'      <site name="axle" pos="0 0 {height:.9g}"/>\n'
        f"{skids}"
        f'      <body name="payload" pos="{vector(*body.com_m)}">\n'
        f'        <inertial pos="0 0 0" mass="{NO_MASS_KG:g}" diaginertia="1e-9 1e-9 1e-9"/>\n      </body>\n'
        f"{_wheel(figures, 0)}{_wheel(figures, 1)}    </body>\n  </worldbody>\n"
        f"{_tendons(figures)}"
        f"  <actuator>\n{_motor(figures, 0, actuator)}{_motor(figures, 1, actuator)}"
        f"{_passive(figures, 0, actuator)}{_passive(figures, 1, actuator)}"
        "  </actuator>\n"
        f"  <sensor>\n{_sensors(figures, actuator)}  </sensor>\n</mujoco>\n"
    )
