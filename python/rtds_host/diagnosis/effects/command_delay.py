"""command_delay: v_cmd(t - d)."""

from rtds_host.diagnosis.conditions import no_pose
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import NO_DRIVER, USD_FED, as_number, left_out, own, row
from rtds_host.diagnosis.replay.model import LONGEST_DELAY_S

EFFECT = Effect(
    id="command_delay",
    subsystem="timing",
    sided=False,
    parameters=(
        Parameter(
            "seconds",
            "s",
            null=0,
            low=0,
            high=LONGEST_DELAY_S,
            prior_width=0.012,
            starts=(0.003, 0.015, 0.05, 0.15, 0.35),
            meaning="v_cmd acts late",
            steep=True,
        ),
    ),
    apply=add(command_delay="seconds"),
    equation="v_cmd(t - d)",
    source="contract, section 3",
    confused_with=("measurement_delay", "rotor_inertia_error", "backlash"),
    shown_by="steps with the pose measured",
    check="Put an oscilloscope on the command's line and on the motor's terminals: the voltage comes late.",
    advice="Shorten the bus cycle to the driver, or predict over the delay in the controller.",
    runs_in="rtl",
    form=0.005,
    # No whole number of the log's rows: where a late command and a sample meet, rounding decides which comes first.
    compared_at={"seconds": 0.0127},
    same_as={"measurement_delay": no_pose},
    exports=row(own("actuator delay"), NO_DRIVER, left_out("a joint's force acts at once"), as_number(USD_FED)),
    exports_behind_servo={
        "mjcf": as_number("custom/numeric command_delay_s: the speeds asked for are late, not `ctrl`"),
        "sdf": left_out("JointController acts at once"),
    },
)
