"""rolling_resistance: c m g / 2 at each wheel's rim against the motion."""

from rtds_host.diagnosis.conditions import same_load
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import own, row

EFFECT = Effect(
    id="rolling_resistance",
    subsystem="wheel_ground",
    sided=False,
    parameters=(
        Parameter(
            "coefficient",
            "1",
            null=0,
            low=0,
            high=1,
            prior_width=0.03,
            starts=(0.01, 0.05),
            meaning="of the normal force",
        ),
    ),
    apply=add(rolling="coefficient"),
    equation="c m g / 2 at each wheel's rim against the motion",
    source="contract, section 3",
    confused_with=("coulomb_friction", "spin_scrub"),
    shown_by="the same run with two payloads",
    check="Pull the robot over the level with a spring balance, motors disconnected, with payload and without: this "
    "drag grows with the weight, a gear's does not.",
    advice="Inflate or harden the tyres; expect more of it with payload.",
    runs_in="rtl",
    axis=False,
    form=0.02,
    same_as={"coulomb_friction": same_load},
    exports=row(
        own("joint frictionloss at the file's mass; custom/numeric rolling_coefficient for a payload"),
        own("dynamics friction at the file's mass"),
        own("dynamics/friction at the file's mass"),
        own("staticFrictionEffort, dynamicFrictionEffort at the file's mass"),
    ),
    resembles=(
        ("force", "w"),
        ("force", "speed"),
    ),
)
