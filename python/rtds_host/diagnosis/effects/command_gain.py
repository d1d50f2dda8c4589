"""command_gain: the base takes ratio w_cmd for w_cmd."""

from rtds_host.diagnosis.conditions import loop_on_wheels
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import USD_FED, as_number, row

EFFECT = Effect(
    id="command_gain",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=-5,
            high=5,
            prior_width=0.1,
            starts=(0.93, 1.07),
            meaning="speed that the base's loop is asked for over the command",
        ),
    ),
    apply=scale("command_gain"),
    equation="w_ref = ratio w_cmd",
    source="contract, section 3; as a base's unit of speed or its calibrated wheel differs from the host's",
    confused_with=("speed_gain", "wheel_radius_error"),
    shown_by="steps of the commanded speed with wheel speed and pose logged",
    check="Command a slow even speed and count the wheel's turns in a minute: over the command's they are the ratio, "
    "and the reported speed agrees with the count.",
    advice="Divide the commands by the ratio, or correct the base's unit of speed.",
    before_loop=True,
    runs_in="refused",
    nearly_as={"speed_gain": loop_on_wheels},
    exports=row(
        as_number("custom/numeric command_gain, with a servo's loop"),
        as_number("comment: the speeds asked for take the loop's scale"),
        as_number("comment: the speeds asked for take the loop's scale"),
        as_number(f"{USD_FED} servo"),
    ),
    exports_dcmotor=as_number("driver module, by custom/numeric command_gain, with the servo's loop"),
)
