"""speed_gain: w and th reported times ratio."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import loop_beyond_wheels, loop_on_wheels, speed_alone, torque_drives
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import as_number, reading
from rtds_host.diagnosis.scales import Scales


def _other_radius(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float] | None:
    """The radius with which a base drives as far as one that counts its wheels' turns at this scale.

    Times its own where it is in already.
    """
    if values["ratio"] <= 0.0:
        return None
    return {"ratio": (existing["ratio"] if existing else 1.0) / values["ratio"]}


EFFECT = Effect(
    id="speed_gain",
    subsystem="sensing",
    sided=True,
    parameters=(
        Parameter(
            "ratio", "1", null=1, low=-3, high=3, prior_width=0.04, starts=(0.97, 1.03), meaning="reported over true"
        ),
    ),
    apply=scale("speed_gain"),
    equation="w and th reported times ratio",
    source="contract, section 3",
    confused_with=("wheel_radius_error", "driver_gain", "torque_constant_error"),
    shown_by="straight runs with the pose measured",
    check="Turn the wheel by hand through ten whole turns and read its logged angle: anything but 62.83 rad is the "
    "encoder's scale, whatever the tyre.",
    advice="Set the counts a turn and the gear ratio in the driver.",
    scales=("w", "th"),
    # One edge counted in place of two, or two in place of one.
    starts_in_loop=({"ratio": 0.5}, {"ratio": 2.0}),
    runs_in="signal",
    same_as={"driver_gain": speed_alone},
    same_with_friction={"payload_error": torque_drives, "driver_gain": torque_drives},
    nearly_as={"command_gain": loop_on_wheels, "wheel_radius_error": loop_beyond_wheels},
    approximated_by={"wheel_radius_error": _other_radius},
    exports=reading("speed_gain"),
    exports_behind_servo={
        "urdf": as_number("the loop's gains have it, and the speeds asked for take the scale in the comment"),
        "sdf": as_number("the loop's gains have it, and the speeds asked for take the scale in the comment"),
    },
    resembles=(("speed_sensor", "w"),),
    exports_dcmotor=as_number("driver module, by custom/numeric speed_gain"),
)
