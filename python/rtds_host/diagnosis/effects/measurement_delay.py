"""measurement_delay: reported(t) = true(t - d)."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import no_pose
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import NO_SENSOR, USD_READ, as_number, left_out, own, row
from rtds_host.diagnosis.replay.model import LONGEST_DELAY_S
from rtds_host.diagnosis.scales import Scales


def _speed_delayed(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float]:
    """The delay as one of the speed alone; after a lag that is there already."""
    lag, held = (existing["time_constant_s"], existing["delay_s"]) if existing else (0.0, 0.0)
    return {"time_constant_s": lag + values["seconds"], "delay_s": held + values["seconds"]}


EFFECT = Effect(
    id="measurement_delay",
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
            meaning="i, w, th, gyro and v_bus are reported late",
            steep=True,
        ),
    ),
    apply=add(measurement_delay="seconds"),
    equation="reported(t) = true(t - d); x, y, yaw are not delayed",
    source="contract, section 3",
    confused_with=("command_delay", "speed_filter"),
    shown_by="steps with the pose measured",
    check="Stop the wheel against a hard stop in view of a camera, or a light barrier, that shares the log's clock: "
    "the log shows the stop late.",
    advice="Stamp the samples at the sensor, or shift them by the delay.",
    runs_in="signal",
    form=0.005,
    approximated_by={"speed_filter": _speed_delayed},
    # No whole number of the log's rows: where a late command and a sample meet, rounding decides which comes first.
    compared_at={"seconds": 0.0127},
    same_as={"command_delay": no_pose},
    exports=row(own("sensor delay"), NO_SENSOR, left_out("sensors there are not late"), as_number(USD_READ)),
    exports_dcmotor=as_number("sensor delay; of the current driver module, by custom/numeric current_delay_s"),
)
