"""What each target can express of each effect: the one place that says so.

    python -m rtds_host.export.table docs/export.md
    python -m rtds_host.export.table docs/mujoco-dcmotor.md

write it into a page, or what differs for MuJoCo's `<dcmotor>`. Whoever adds an effect to the catalogue adds a row here;
`python/tests/export` compares the two, and the pages with this.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from rtds_host.diagnosis.effects import CATALOGUE

TARGETS = ("mjcf", "urdf", "sdf", "usd-json", "python")
# How a target has an effect: it acts on its own there; it is in the file as a number that whoever feeds the
# commands or reads the sensors applies; or it is left out.
OWN, CARRIED, LOST = "own", "number", "lost"


@dataclass(frozen=True)
class How:
    """`kind` is one of the three above, `where` the element that holds it, or why none does."""

    kind: str
    where: str


def _own(where: str) -> How:
    return How(OWN, where)


def _carried(where: str) -> How:
    return How(CARRIED, where)


def _lost(why: str) -> How:
    return How(LOST, why)


def _row(mjcf: How, urdf: How, sdf: How, usd: How, python: How | None = None) -> dict[str, How]:
    return dict(zip(TARGETS, (mjcf, urdf, sdf, usd, python or _own("`Robot`")), strict=True))


_NO_DRIVER = _lost("a joint is driven by a torque there, there is no driver before it")
_TO_EFFORT = "torque a volt, damping (back EMF) and limits of the wheel's joint"
_NO_SENSOR = _lost("URDF has no sensors")
_BODY = "inertials and joint origins"
_USD_READ = "rtds.sensors"
_USD_FED = "rtds.actuators"


def _map_of_commands(number: str) -> dict[str, How]:
    return _row(_carried(f"custom/numeric {number}"), _NO_DRIVER, _NO_DRIVER, _carried(_USD_FED))


def _electrical() -> dict[str, How]:
    return _row(
        _own("actuator/general gainprm, biasprm, gear"),
        _own(_TO_EFFORT),
        _own(_TO_EFFORT),
        _carried(f"{_USD_FED} torque_nm_per_v, back_emf_nm_s_per_rad"),
    )


def _of_body(usd: str = "physics:mass, physics:diagonalInertia, physics:centerOfMass") -> dict[str, How]:
    return _row(_own("inertial, pos, size"), _own(_BODY), _own(_BODY), _own(usd))


def _reading(number: str, sdf: How | None = None) -> dict[str, How]:
    return _row(
        _carried(f"custom/numeric {number}"),
        _NO_SENSOR,
        sdf or _lost("SDF has no such sensor of a joint"),
        _carried(_USD_READ),
    )


TABLE: dict[str, dict[str, How]] = {
    # driver
    "supply_sag": _map_of_commands("source_resistance_ohm"),
    "battery_decline": _map_of_commands("decline_v_per_s"),
    "driver_deadzone": _map_of_commands("deadzone_v"),
    "bridge_drop": _map_of_commands("drop_v, back_emf_v_s_per_rad"),
    "driver_gain": _electrical(),
    "voltage_limit": _row(
        _own("actuator ctrlrange"),
        _own("limit effort and velocity"),
        _own("limit effort and velocity"),
        _own("drive maxForce, maxJointVelocity"),
    ),
    "pwm_curve": _map_of_commands("pwm_curve"),
    "command_gain": _row(
        _carried("custom/numeric command_gain, with a servo's loop"),
        _carried("comment: the speeds asked for take the loop's scale"),
        _carried("comment: the speeds asked for take the loop's scale"),
        _carried(f"{_USD_FED} servo"),
    ),
    # winding
    "resistance_error": _electrical(),
    "winding_heating": _row(
        _own("actuator/dcmotor thermal"),
        _lost("a joint has no winding"),
        _lost("a joint has no winding"),
        _lost("a drive has no winding"),
    ),
    "torque_constant_error": _electrical(),
    # drivetrain
    "coulomb_friction": _row(
        _own("joint frictionloss"),
        _own("dynamics friction"),
        _own("dynamics/friction"),
        _own("staticFrictionEffort, dynamicFrictionEffort"),
    ),
    "stribeck_friction": _row(
        _own("actuator/dcmotor lugre"),
        _own("dynamics friction: the level at speed, without the rise at rest"),
        _own("dynamics/friction: the level at speed, without the rise at rest"),
        _own("staticFrictionEffort, dynamicFrictionEffort: two levels, no speed over which one fades"),
    ),
    "viscous_friction": _row(
        _own("joint damping"), _own("dynamics damping"), _own("dynamics/damping"), _own("viscousFrictionCoefficient")
    ),
    "friction_asymmetry": _row(
        _own("actuator/general biasprm, where dry friction is at least as large; without its part by speed"),
        _lost("friction is the same in both directions"),
        _lost("friction is the same in both directions"),
        _lost("friction is the same in both directions"),
    ),
    "load_friction": _row(*[_lost("friction there does not grow with the torque that a gear transmits")] * 4),
    "backlash": _row(
        _own("a second hinge with a range; its flanks do not rebound"),
        *[_lost("the joint is rigid")] * 3,
        _lost("its gear is rigid"),
    ),
    "gear_compliance": _row(
        _own("a second hinge with stiffness and damping"),
        *[_lost("the joint is rigid")] * 3,
        _lost("its gear is rigid"),
    ),
    "torque_ripple": _row(_own("actuator/dcmotor cogging"), *[_lost("no torque by the angle of a joint")] * 3),
    "rotor_inertia_error": _row(
        _own("joint armature"),
        _lost("a joint has no armature"),
        _lost("a joint has no armature"),
        _own("physxJointAxis armature"),
    ),
    # wheel and ground
    "wheel_radius_error": _row(
        _own("geom size, wheels' pos"),
        _own("collision sphere, joint origin"),
        _own("collision sphere, joint pose"),
        _own("radius"),
    ),
    "longitudinal_slip": _row(
        *[_lost("a contact creeps by force alone or slides, not by a share of the speed")] * 4,
        _lost("its tyre builds up over a length of rolling and saturates; the module rolls without slip"),
    ),
    "spin_scrub": _row(
        _own("tendon/fixed frictionloss of the yaw angle that both wheels roll"),
        *[_lost("a contact's torsional friction depends on how the load is shared among the points of support")] * 3,
    ),
    "rolling_resistance": _row(
        _own("joint frictionloss at the file's mass; custom/numeric rolling_coefficient for a payload"),
        _own("dynamics friction at the file's mass"),
        _own("dynamics/friction at the file's mass"),
        _own("staticFrictionEffort, dynamicFrictionEffort at the file's mass"),
    ),
    # chassis
    "track_width_error": _row(_own("wheels' pos"), _own("joint origin"), _own("joint pose"), _own("joint pos")),
    "payload_error": _of_body(),
    "com_offset": _of_body(),
    "slope_error": _row(
        _own("option gravity; custom/numeric slope_extra_rad for a run on a slope"),
        _lost("URDF has no world"),
        _carried("comment: gravity belongs to the world, not to a model"),
        _carried("rtds.world"),
    ),
    "yaw_inertia_error": _of_body(),
    # sensing
    "speed_gain": _reading("speed_gain"),
    "current_gain": _reading("current_gain"),
    "current_bias": _reading("current_bias_a"),
    "speed_filter": _reading("speed_filter_s; sensor delay: what of its lag is a delay"),
    "gyro_bias": _reading("gyro_bias_rad_s", _own("sensor imu, noise/bias_mean")),
    "gyro_gain": _reading("gyro_gain", _lost("an imu's noise has no scale")),
    # timing
    "command_delay": _row(
        _own("actuator delay"), _NO_DRIVER, _lost("a joint's force acts at once"), _carried(_USD_FED)
    ),
    "measurement_delay": _row(
        _own("sensor delay"), _NO_SENSOR, _lost("sensors there are not late"), _carried(_USD_READ)
    ),
}

# What writes another effect's parameters goes where those go.
TABLE |= {name: TABLE[effect.exports_as] for name, effect in CATALOGUE.items() if effect.exports_as}

# The loop of a robot that is driven by wheel speeds (`mode = "speed"`), and the effects that such a robot has
# otherwise.
SERVO = _row(
    _carried("custom/numeric servo_kp_v_s_per_rad, servo_ki_v_per_rad, servo_limit_v, servo_period_s"),
    _carried("comment: the loop's gains and limits as torques"),
    _own("plugin JointController"),
    _carried(f"{_USD_FED} servo"),
)
_SCALED = "the loop's gains have it, and the speeds asked for take the scale in the comment"
BEHIND_SERVO: dict[str, dict[str, How]] = {
    "mjcf": {"command_delay": _carried("custom/numeric command_delay_s: the speeds asked for are late, not `ctrl`")},
    "urdf": {"speed_gain": _carried(_SCALED)},
    "sdf": {"speed_gain": _carried(_SCALED), "command_delay": _lost("JointController acts at once")},
    "usd-json": {},
    "python": {},
}

# What differs with `--actuator dcmotor`. "driver module": the Python module that is written along.
_MODULE = "driver module"
_ELEMENT = _own("actuator/dcmotor motorconst, resistance, inductance, gear")


def _module(number: str) -> How:
    return _carried(f"{_MODULE}, by custom/numeric {number}")


DCMOTOR: dict[str, How] = {
    "resistance_error": _ELEMENT,
    "torque_constant_error": _ELEMENT,
    "driver_gain": _ELEMENT,
    "winding_heating": _own("actuator/dcmotor thermal"),
    "stribeck_friction": _own("actuator/dcmotor lugre"),
    "torque_ripple": _own("actuator/dcmotor cogging"),
    "load_friction": _module("load_share: bound of the joint's dry friction, by the torque of the step before"),
    "friction_asymmetry": _carried(
        f"actuator/general biasprm, where dry friction is at least as large; by speed {_MODULE}, by custom/numeric "
        "asymmetry_nm_s_per_rad"
    ),
    "supply_sag": _module("source_resistance_ohm"),
    "battery_decline": _module("decline_v_per_s"),
    "driver_deadzone": _module("deadzone_v"),
    "pwm_curve": _module("pwm_curve"),
    "bridge_drop": _module("drop_v, back_emf_v_s_per_rad, voltage_gain"),
    "current_gain": _module("current_gain"),
    "current_bias": _module("current_bias_a"),
    "speed_gain": _module("speed_gain"),
    "speed_filter": _module("speed_filter_s; sensor delay: what of its lag is a delay"),
    "gyro_bias": _module("gyro_bias_rad_s"),
    "gyro_gain": _module("gyro_gain"),
    "command_gain": _module("command_gain, with the servo's loop"),
    "measurement_delay": _carried(f"sensor delay; of the current {_MODULE}, by custom/numeric current_delay_s"),
}

START, END = "<!-- export: begin -->", "<!-- export: end -->"
START_DCMOTOR, END_DCMOTOR = "<!-- dcmotor: begin -->", "<!-- dcmotor: end -->"


def markdown() -> str:
    """The table of the documentation."""
    lines = ["| effect | " + " | ".join(f"`{target}`" for target in TARGETS) + " |", "|---" * (len(TARGETS) + 1) + "|"]
    for effect, row in (("[servo]", SERVO), *sorted(TABLE.items())):
        cells = [f"*{how.kind}*: {how.where}" if how.kind != LOST else f"left out: {how.where}" for how in row.values()]
        lines.append(f"| `{effect}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def markdown_of_dcmotor() -> str:
    """What differs with `--actuator dcmotor`, as it stands in the documentation."""
    lines = ["| effect | with `--actuator dcmotor` |", "|---|---|"]
    lines += [f"| `{effect}` | *{how.kind}*: {how.where} |" for effect, how in sorted(DCMOTOR.items())]
    return "\n".join(lines) + "\n"


def put_into(page: Path) -> None:
    """Write a table into a page, between its two marks."""
    text = page.read_text(encoding="utf-8")
    for start, end, table in ((START, END, markdown), (START_DCMOTOR, END_DCMOTOR, markdown_of_dcmotor)):
        if start in text:
            before, _, rest = text.partition(start)
            text = f"{before}{start}\n{table()}{end}{rest.partition(end)[2]}"
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    put_into(Path(sys.argv[1]))
