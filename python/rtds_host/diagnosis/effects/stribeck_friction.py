"""stribeck_friction: -(tau + tau_s exp(-(w/w_s)^2)) sgn(w)."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import own, row
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    model.add("coulomb", values["torque_nm"], sides)
    model.add("stribeck", values["extra_torque_nm"], sides)
    model.put("stribeck_speed", values["speed_rad_s"], sides)


EFFECT = Effect(
    id="stribeck_friction",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "torque_nm",
            "N·m",
            scale="torque",
            null=0,
            low=0,
            high=2,
            prior_width=0.017,
            starts=(0.0085,),
            meaning="dry friction at speed, at the wheel",
        ),
        Parameter(
            "extra_torque_nm",
            "N·m",
            scale="torque",
            null=0,
            low=0,
            high=2,
            prior_width=0.017,
            starts=(0.0085, 0.025),
            meaning="extra dry friction at rest",
        ),
        Parameter(
            "speed_rad_s",
            "rad/s",
            scale="speed",
            null=0.07,
            low=0.003,
            high=3,
            prior_width=0.1,
            starts=(0.042, 0.17),
            shape=True,
            meaning="speed over which the extra fades",
        ),
    ),
    apply=_apply,
    equation="-(tau + tau_s exp(-(w/w_s)^2)) sgn(w)",
    source="contract, section 3; R. Stribeck, VDI-Zeitschrift 46, 1902; Armstrong-Helouvry et al. 1994",
    confused_with=("coulomb_friction", "driver_deadzone"),
    shown_by="slow crawl with reversals",
    check="Turn the wheel in the air ever more slowly: the current rises again towards standstill.",
    advice="Grease for low speed, dither the command, or avoid very slow motion.",
    runs_in="rtl",
    contains=("coulomb_friction",),
    form=0.02,
    compared_at={"torque_nm": 0.02, "extra_torque_nm": 0.04, "speed_rad_s": 0.5},
    friction=True,
    exports=row(
        own("actuator/dcmotor lugre", needs="MuJoCo 4.0 or later"),
        own("dynamics friction: the level at speed, without the rise at rest"),
        own("dynamics/friction: the level at speed, without the rise at rest"),
        own("staticFrictionEffort, dynamicFrictionEffort: two levels, no speed over which one fades"),
    ),
    resembles=(("torque", "w"),),
    exports_dcmotor=own("actuator/dcmotor lugre; in its place with the driver module dry friction by speed"),
)
