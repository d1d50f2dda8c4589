"""What a target of `rtds export` can express of an effect: how an effect's file says it.

`rtds_host.export.table` makes the table of all effects from it.
"""

from __future__ import annotations

from dataclasses import dataclass

TARGETS = ("mjcf", "urdf", "sdf", "usd-json", "python")
# How a target has an effect: it acts on its own there; it is in the file as a number that whoever feeds the
# commands or reads the sensors applies; or it is left out.
OWN, AS_NUMBER, LEFT_OUT = "own", "number", "lost"


@dataclass(frozen=True)
class How:
    """`kind` is one of the three above, `where` the element that holds it, or why none does; `needs` the version of the
    target that has it, where not every one does."""

    kind: str
    where: str
    needs: str = ""


def own(where: str, needs: str = "") -> How:
    """It acts there on its own, in this element."""
    return How(OWN, where, needs)


def as_number(where: str) -> How:
    """It is in this element as a number."""
    return How(AS_NUMBER, where)


def left_out(why: str) -> How:
    """It is left out, and why."""
    return How(LEFT_OUT, why)


def row(mjcf: How, urdf: How, sdf: How, usd: How, python: How | None = None) -> dict[str, How]:
    """How each target has an effect, by target; the Python module has all on its own unless it says otherwise."""
    return dict(zip(TARGETS, (mjcf, urdf, sdf, usd, python or own("`Robot`")), strict=True))


NO_DRIVER = left_out("a joint is driven by a torque there, there is no driver before it")
TO_EFFORT = "torque a volt, damping (back EMF) and limits of the wheel's joint"
RIGID = left_out("the joint is rigid")
NO_SENSOR = left_out("URDF has no sensors")
BODY = "inertials and joint origins"
USD_READ = "rtds.sensors"
USD_FED = "rtds.actuators"


def map_of_commands(number: str) -> dict[str, How]:
    """An effect on commands: no target has a driver, a number is in the file."""
    return row(as_number(f"custom/numeric {number}"), NO_DRIVER, NO_DRIVER, as_number(USD_FED))


def electrical() -> dict[str, How]:
    """An effect in the line of torque over voltage and speed."""
    return row(
        own("actuator/general gainprm, biasprm, gear"),
        own(TO_EFFORT),
        own(TO_EFFORT),
        as_number(f"{USD_FED} torque_nm_per_v, back_emf_nm_s_per_rad"),
    )


def of_body(usd: str = "physics:mass, physics:diagonalInertia, physics:centerOfMass") -> dict[str, How]:
    """An effect in mass, inertia or centre of mass."""
    return row(own("inertial, pos, size"), own(BODY), own(BODY), own(usd))


def reading(number: str, sdf: How | None = None) -> dict[str, How]:
    return row(
        as_number(f"custom/numeric {number}"),
        NO_SENSOR,
        sdf or left_out("SDF has no such sensor of a joint"),
        as_number(USD_READ),
    )
