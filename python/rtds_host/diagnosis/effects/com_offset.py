"""com_offset: gravity turns the robot on a slope."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import of_body

EFFECT = Effect(
    id="com_offset",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter(
            "x_m",
            "m",
            scale="track",
            null=0,
            low=-2,
            high=2,
            prior_width=0.12,
            starts=(0.06, -0.06),
            meaning="forward of the axle's mid-point",
        ),
        Parameter(
            "y_m",
            "m",
            scale="track",
            null=0,
            low=-2,
            high=2,
            prior_width=0.12,
            starts=(0.03, -0.03),
            meaning="to the left",
        ),
    ),
    apply=add(com_x="x_m", com_y="y_m"),
    equation="gravity turns the robot on a slope; m x yaw_rate^2 and m x v yaw_rate act",
    source="contract, section 3; Y. Yamamoto, X. Yun, IEEE Trans. Autom. Control 39(6), 1994",
    confused_with=("yaw_inertia_error", "slope_error"),
    shown_by="a slope across and along, with payload",
    check=(
        "Weigh the robot with a scale under each wheel and under the caster: the three weights say where its mass is."
    ),
    advice="Weigh each wheel; move the payload over the axle.",
    separate=True,
    runs_in="robot",
    axis=False,
    form=0.02,
    compared_at={"x_m": 0.03, "y_m": 0.012},
    exports=of_body(),
    resembles=(("yaw_torque", "speed_yaw_rate"),),
)
