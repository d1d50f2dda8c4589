"""voltage_limit: |V| <= limit."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put

EFFECT = Effect(
    id="voltage_limit",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter("volts", "V", null=24, low=0.2, high=1000, spread=6, starts=(10.0, 8.0, 6.0, 4.0),
                  meaning="largest voltage"),
    ),
    apply=put(limit="volts"),
    equation="|V| <= limit",
    source="contract, section 3",
    confused_with=("driver_gain", "supply_sag"),
    shown_by="full speed in both directions",
    advice="Look for a duty or current limit in the driver's settings.",
    runs_in="rtl",
)
