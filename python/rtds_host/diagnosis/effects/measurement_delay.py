"""measurement_delay: reported(t) = true(t - d)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.replay.model import LONGEST_DELAY_S

EFFECT = Effect(
    id="measurement_delay",
    subsystem="timing",
    sided=False,
    parameters=(
        Parameter("seconds", "s", null=0, low=0, high=LONGEST_DELAY_S, spread=0.012, starts=(0.003, 0.015, 0.05, 0.15, 0.35),
                  meaning="i, w, th, gyro and v_bus are reported late"),
    ),
    apply=add(measurement_delay="seconds"),
    equation="reported(t) = true(t - d); x, y, yaw are not delayed",
    source="contract, section 3",
    confused_with=("command_delay", "speed_filter"),
    shown_by="steps with the pose measured",
    check="Stop the wheel against a hard stop in view of a camera, or a light barrier, that shares the log's clock: "
          "the log shows the stop late.",
    advice="Stamp the samples at the sensor, or shift them by the delay.",
    steep=True,
    runs_in="signal",
    form=0.005,
)
