"""spin_scrub: -tau sgn(yaw rate)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import left_out, own, row

EFFECT = Effect(
    id="spin_scrub",
    subsystem="wheel_ground",
    sided=False,
    parameters=(
        Parameter(
            "torque_nm",
            "N·m",
            scale="spin",
            null=0,
            low=0,
            high=1,
            prior_width=0.0035,
            starts=(0.0009, 0.007),
            meaning="against the yaw rate",
        ),
    ),
    apply=add(scrub="torque_nm"),
    equation="-tau sgn(yaw rate)",
    source="contract, section 3",
    confused_with=("coulomb_friction", "rolling_resistance"),
    shown_by="spinning on the spot against straight runs",
    check="Turn the robot on the spot with its caster lifted or on a slippery plate: what scrubs is gone, what the "
    "gears lose stays.",
    advice="Use narrower tyres or a freer caster.",
    runs_in="robot",
    axis=False,
    form=0.02,
    exports=row(
        own("tendon/fixed frictionloss of the yaw angle that both wheels roll"),
        *[left_out("a contact's torsional friction depends on how the load is shared among the points of support")] * 3,
    ),
    resembles=(
        ("torque", "yaw_rate"),
        ("yaw_torque", "yaw_rate"),
    ),
)
