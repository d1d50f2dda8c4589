"""gyro_gain: gyro reported times ratio."""

from rtds_host.diagnosis.conditions import turns_without_pose
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import as_number, left_out, reading

EFFECT = Effect(
    id="gyro_gain",
    subsystem="sensing",
    sided=False,
    parameters=(
        Parameter(
            "ratio", "1", null=1, low=-3, high=3, prior_width=0.05, starts=(0.96, 1.04), meaning="reported over true"
        ),
    ),
    apply=scale("gyro_gain"),
    equation="gyro reported times ratio",
    source="contract, section 3",
    confused_with=("track_width_error",),
    shown_by="spinning on the spot with the pose measured",
    check="Turn the robot by hand through ten whole turns and add up the gyro: anything but 62.83 rad is the gyro's "
    "scale, whatever the wheels do.",
    advice="Set the gyro's scale from the ten turns.",
    seen_by=("gyro",),
    runs_in="signal",
    axis=False,
    same_as={"track_width_error": turns_without_pose, "wheel_radius_error": turns_without_pose},
    exports=reading("gyro_gain", left_out("an imu's noise has no scale")),
    resembles=(("gyro_sensor", "yaw_rate"),),
    exports_dcmotor=as_number("driver module, by custom/numeric gyro_gain"),
)
