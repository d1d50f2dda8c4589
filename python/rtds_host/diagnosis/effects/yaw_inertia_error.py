"""yaw_inertia_error: I_z = ratio I_z nominal."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import of_body

EFFECT = Effect(
    id="yaw_inertia_error",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.05,
            high=50,
            prior_width=1.0,
            starts=(0.5, 2.0, 5.0),
            meaning="I_z over its nominal value",
            of="chassis.yaw_inertia_kg_m2",
        ),
    ),
    apply=scale("yaw_inertia"),
    equation="I_z = ratio I_z nominal",
    source="contract, section 3",
    confused_with=("spin_scrub", "rotor_inertia_error"),
    shown_by="pseudo-random spinning with gyro",
    check="Hang the robot on two threads and time its swing about the vertical.",
    advice="Set the yaw inertia from the swing.",
    runs_in="robot",
    axis=False,
    compared_at={"ratio": 5.0},
    exports=of_body(),
)
