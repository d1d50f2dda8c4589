"""wheel_radius_error: v = ratio r w."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import loop_beyond_wheels, no_place, straight_without_place, turns_without_pose
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import own, row
from rtds_host.diagnosis.scales import Scales


def _other_counts(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float]:
    """The scale of the encoders at which a base drives as far as one with wheels of this radius.

    Times its own where it is in already.
    """
    return {"ratio": (existing["ratio"] if existing else 1.0) / values["ratio"]}


EFFECT = Effect(
    id="wheel_radius_error",
    subsystem="wheel_ground",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.3,
            high=3,
            prior_width=0.05,
            starts=(0.96, 1.04),
            meaning="r over its nominal value",
            of="chassis.wheel_radius_m",
        ),
    ),
    apply=scale("radius"),
    equation="v = ratio r w",
    source="contract, section 3; J. Borenstein, L. Feng, IEEE Trans. Robot. Autom. 12(6), 1996",
    confused_with=("speed_gain", "track_width_error"),
    shown_by="straight and turning runs with the pose measured",
    check="Mark tyre and floor, push the robot straight through ten whole turns of the wheel under its own weight, "
    "and measure the way: it is 62.83 times the radius, whatever the encoder says.",
    advice="Set the measured radius.",
    runs_in="robot",
    axis=False,
    same_as={"track_width_error": no_place, "gyro_gain": turns_without_pose},
    nearly_as={"payload_error": straight_without_place, "speed_gain": loop_beyond_wheels},
    approximated_by={"speed_gain": _other_counts},
    exports=row(
        own("geom size, wheels' pos"),
        own("collision sphere, joint origin"),
        own("collision sphere, joint pose"),
        own("radius"),
    ),
)
