"""track_width_error: yaw rate = r (w_r - w_l) / (ratio b)."""

from rtds_host.diagnosis.conditions import no_place, turns_without_pose
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import own, row

EFFECT = Effect(
    id="track_width_error",
    subsystem="chassis",
    sided=False,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.3,
            high=3,
            prior_width=0.05,
            starts=(0.95, 1.05),
            meaning="b over its nominal value",
            of="chassis.track_width_m",
        ),
    ),
    apply=scale("track"),
    equation="yaw rate = r (w_r - w_l) / (ratio b)",
    source="contract, section 3; Borenstein, Feng 1996",
    confused_with=("wheel_radius_error", "gyro_gain"),
    shown_by="spinning on the spot with gyro and pose",
    check=(
        "Turn ten times on the spot against a mark on the floor: the way of each wheel (angle times radius) is 31.4"
        " times the track width, whatever the gyro says."
    ),
    advice="Set the measured track width.",
    runs_in="robot",
    axis=False,
    same_as={"wheel_radius_error": no_place, "gyro_gain": turns_without_pose},
    exports=row(own("wheels' pos"), own("joint origin"), own("joint pose"), own("joint pos")),
)
