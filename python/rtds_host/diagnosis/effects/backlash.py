"""backlash: free play between gear and wheel, centred at the start."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import RIGID, left_out, own, row

EFFECT = Effect(
    id="backlash",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "angle_rad",
            "rad",
            null=0,
            low=0,
            high=0.6,
            prior_width=0.04,
            difference=0.05,
            starts=(0.003, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.11, 0.16),
            meaning="total free play",
        ),
        Parameter(
            "restitution",
            "1",
            null=0.0,
            low=0.0,
            high=0.8,
            prior_width=0.2,
            starts=(0.0,),
            difference=0.25,
            optional=True,
            shape=True,
            meaning="relative speed of the flanks after an impact over that before",
        ),
    ),
    apply=add(backlash="angle_rad", restitution="restitution"),
    equation=(
        "free play between gear and wheel, centred at the start; flanks meet with Newton's law of impact, w' = -e w"
    ),
    source="contract, section 3; M. Nordin, P.-O. Gutman, Automatica 38(10), 2002; J. J. Moreau, 1988 (impact)",
    confused_with=("gear_compliance", "command_delay"),
    shown_by="reversals and pseudo-random voltage",
    check=(
        "Hold the motor's shaft still and turn the wheel by hand to and fro: with free play it moves without any "
        "force, then stops hard."
    ),
    advice="Preload or replace the gear; avoid torque reversals at rest.",
    nonlinear=True,
    rough=True,
    gives=True,
    runs_in="robot",
    form=0.05,
    compared_at={"angle_rad": 0.03, "restitution": 0.0},
    agrees_within=(
        2.0,
        "a sample that falls on an impact shows the speed before it in the one and after it in the other",
    ),
    exports=row(
        own("a second hinge with a range; its flanks do not rebound"),
        RIGID,
        RIGID,
        RIGID,
        left_out("its gear is rigid"),
    ),
)
