"""torque_constant_error: Km = Kb = ratio K_nominal."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import no_current
from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import electrical, own
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    model.scale("torque_constant", values["ratio"], sides)
    model.scale("back_emf", values["ratio"], sides)


EFFECT = Effect(
    id="torque_constant_error",
    subsystem="winding",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.6,
            high=1.7,
            prior_width=0.12,
            starts=(0.92, 1.1),
            meaning="Km and Kb over their nominal values",
            of="motor.torque_constant_nm_per_a",
        ),
    ),
    apply=_apply,
    equation="Km = Kb = ratio K_nominal",
    source="contract, section 3",
    confused_with=("driver_gain", "resistance_error", "speed_gain"),
    shown_by="coasting and hill climbing with current logged",
    check=(
        "Turn the motor from outside at a known speed and measure its open terminals: volts over rad/s is the constant."
    ),
    advice="Set the measured constant; a weak one means an aged or hot magnet, or another motor.",
    without_winding=False,
    runs_in="rtl",
    nuisance=True,
    nearly_as={"resistance_error": no_current, "payload_error": no_current},
    exports=electrical(),
    resembles=(("torque_constant", "i"),),
    exports_dcmotor=own("actuator/dcmotor motorconst, resistance, inductance, gear"),
)
