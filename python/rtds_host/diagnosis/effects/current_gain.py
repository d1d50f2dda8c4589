"""current_gain: i reported times ratio."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import as_number, reading

EFFECT = Effect(
    id="current_gain",
    subsystem="sensing",
    sided=True,
    parameters=(
        Parameter(
            "ratio", "1", null=1, low=-3, high=5, prior_width=0.1, starts=(0.93, 1.08), meaning="reported over true"
        ),
    ),
    apply=scale("current_gain"),
    equation="i reported times ratio",
    source="contract, section 3",
    confused_with=("resistance_error", "torque_constant_error"),
    shown_by="loaded runs with current and speed",
    check="Put an ammeter in series with the motor and compare both readings at two loads.",
    advice="Calibrate the shunt and its amplifier.",
    seen_by=("i",),
    scales=("i",),
    runs_in="signal",
    exports=reading("current_gain"),
    resembles=(
        ("torque_constant", "i"),
        ("current_sensor", "i"),
    ),
    exports_dcmotor=as_number("driver module, by custom/numeric current_gain"),
)
