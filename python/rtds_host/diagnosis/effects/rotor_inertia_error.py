"""rotor_inertia_error: J = ratio J_nominal."""

from rtds_host.diagnosis.conditions import rotor_counts
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import left_out, own, row

EFFECT = Effect(
    id="rotor_inertia_error",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.05,
            high=10,
            prior_width=0.2,
            starts=(0.85, 1.2),
            meaning="J over its nominal value",
            of="motor.rotor_inertia_kg_m2",
        ),
    ),
    apply=scale("rotor_inertia"),
    equation="J = ratio J_nominal",
    source="contract, section 3",
    confused_with=("command_delay", "measurement_delay", "payload_error"),
    shown_by="steps and pseudo-random voltage",
    check="Step the voltage with the wheel in the air: with more inertia the speed starts at once and rises slowly, "
    "with a delay it starts late.",
    advice="Set J from the step response in the air.",
    runs_in="rtl",
    nuisance=True,
    same_as={"payload_error": rotor_counts},
    exports=row(
        own("joint armature"),
        left_out("a joint has no armature"),
        left_out("a joint has no armature"),
        own("physxJointAxis armature"),
    ),
)
