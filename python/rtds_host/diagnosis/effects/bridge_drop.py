"""bridge_drop: V = v_cmd - v tanh(i / knee)."""

from collections.abc import Mapping

from rtds_host.diagnosis.conditions import no_current_no_reversal
from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    model.add("drop", values["volts"], sides)
    model.put("drop_knee", values["knee_a"], sides)


EFFECT = Effect(
    id="bridge_drop",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "volts",
            "V",
            scale="volts",
            most="asked",
            null=0,
            low=0,
            high=0.7,
            prior_width=0.025,
            starts=(0.01, 0.04),
            meaning="brush and bridge drop",
        ),
        Parameter(
            "knee_a",
            "A",
            scale="amps",
            null=0,
            low=0,
            high=0.5,
            prior_width=0.01,
            starts=(0.003,),
            optional=True,
            shape=True,
            meaning="current at which 0.76 of the drop is reached; 0 = any",
        ),
    ),
    apply=_apply,
    equation="V = v_cmd - v tanh(i / knee)",
    source="contract, section 3; brush drop: A. E. Fitzgerald et al., Electric Machinery, ch. 7",
    confused_with=("driver_deadzone", "coulomb_friction"),
    shown_by="braking and coasting with current logged",
    check="Measure the voltage at the motor's terminals at several commands, under load: the same voltage is missing "
    "at each.",
    advice="Use a bridge with lower on-resistance, or add the drop to the command by the sign of the current.",
    without_winding=False,
    runs_in="rtl",
    same_as={"coulomb_friction": no_current_no_reversal, "driver_deadzone": no_current_no_reversal},
    exports=map_of_commands("drop_v, drop_knee_a, back_emf_v_s_per_rad"),
    resembles=(("voltage", "i"),),
    exports_dcmotor=as_number(
        "driver module, by custom/numeric drop_v, drop_knee_a, back_emf_v_s_per_rad, voltage_gain"
    ),
)
