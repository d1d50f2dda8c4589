"""gyro_bias: gyro reported plus a constant."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, own, reading

EFFECT = Effect(
    id="gyro_bias",
    subsystem="sensing",
    sided=False,
    parameters=(
        Parameter(
            "rad_s",
            "rad/s",
            scale="turn",
            null=0,
            low=-0.7,
            high=0.7,
            prior_width=0.0014,
            starts=(0.0014, -0.0014),
            meaning="added to the gyro",
        ),
    ),
    apply=add(gyro_bias="rad_s"),
    equation="gyro reported plus a constant",
    source="contract, section 3",
    confused_with=("wheel_radius_error",),
    shown_by="standstill with gyro",
    check="Read the gyro while the robot is still: it should be 0.",
    advice="Average the gyro at standstill before a run and subtract it.",
    seen_by=("gyro",),
    runs_in="signal",
    axis=False,
    compared_at={"rad_s": 0.02},
    exports=reading("gyro_bias_rad_s", own("sensor imu, noise/bias_mean")),
    resembles=(("gyro_sensor", "yaw_rate"),),
    exports_dcmotor=as_number("driver module, by custom/numeric gyro_bias_rad_s"),
)
