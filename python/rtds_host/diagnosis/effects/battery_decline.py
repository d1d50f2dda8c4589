"""battery_decline: bus = voltage_v - rate t."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands

EFFECT = Effect(
    id="battery_decline",
    subsystem="driver",
    sided=False,
    parameters=(
        Parameter(
            "rate_v_per_s",
            "V/s",
            scale="decline",
            null=0,
            low=0,
            high=1,
            prior_width=0.02,
            starts=(0.02, 0.1),
            meaning="fall of the bus voltage",
        ),
    ),
    apply=add(decline="rate_v_per_s"),
    equation="bus = voltage_v - rate t",
    source="contract, section 3",
    confused_with=("winding_heating", "supply_sag"),
    shown_by="a long run with steady load",
    check="Log the voltage at the battery over a whole run: it falls steadily, under load and without.",
    advice="Charge or replace the battery, or scale the duty by the measured bus.",
    runs_in="rtl",
    exports=map_of_commands("decline_v_per_s"),
    resembles=(
        ("voltage", "t"),
        ("voltage", "heat"),
    ),
    exports_dcmotor=as_number("driver module, by custom/numeric decline_v_per_s"),
)
