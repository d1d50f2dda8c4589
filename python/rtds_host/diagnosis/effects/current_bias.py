"""current_bias: i reported plus a constant."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, reading

EFFECT = Effect(
    id="current_bias",
    subsystem="sensing",
    sided=True,
    parameters=(
        Parameter(
            "amperes",
            "A",
            scale="amps",
            null=0,
            low=-2,
            high=2,
            prior_width=0.007,
            starts=(0.0035, -0.0035),
            meaning="added to i",
        ),
    ),
    apply=add(current_bias="amperes"),
    equation="i reported plus a constant",
    source="contract, section 3",
    confused_with=("friction_asymmetry",),
    shown_by="standstill with current logged",
    check="Read the current with the motor's leads off: it should be 0.",
    advice="Zero the current sensor at standstill before a run.",
    seen_by=("i",),
    runs_in="signal",
    compared_at={"amperes": 0.02},
    exports=reading("current_bias_a"),
    resembles=(("current_sensor", "i"),),
    exports_dcmotor=as_number("driver module, by custom/numeric current_bias_a"),
)
