"""resistance_error: R = ratio R_nominal."""

from rtds_host.diagnosis.conditions import no_current
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import electrical, own

EFFECT = Effect(
    id="resistance_error",
    subsystem="winding",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=0.5,
            high=2.5,
            prior_width=0.15,
            starts=(0.9, 1.15),
            meaning="R over its nominal value",
            of="motor.resistance_ohm",
        ),
    ),
    apply=scale("resistance"),
    equation="R = ratio R_nominal",
    source="contract, section 3",
    confused_with=("torque_constant_error", "supply_sag", "winding_heating"),
    shown_by="steps and hill climbing with current logged",
    check="Measure the winding's resistance at the terminals, at rest and cold, at several rotor positions.",
    advice="Set the measured resistance; look at brushes, leads and connectors if it is high.",
    without_winding=False,
    runs_in="rtl",
    nuisance=True,
    nearly_as={"torque_constant_error": no_current, "payload_error": no_current},
    exports=electrical(),
    exports_dcmotor=own("actuator/dcmotor motorconst, resistance, inductance, gear"),
)
