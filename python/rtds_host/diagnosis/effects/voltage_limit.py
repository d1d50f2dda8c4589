"""voltage_limit: |V| <= limit."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put
from rtds_host.diagnosis.effects.exported import own, row

EFFECT = Effect(
    id="voltage_limit",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "volts",
            "V",
            scale="volts",
            null=2,
            low=0.02,
            high=100,
            prior_width=0.5,
            starts=(0.83, 0.67, 0.5, 0.33),
            meaning="largest voltage",
        ),
    ),
    apply=put(limit="volts"),
    equation="|V| <= limit",
    source="contract, section 3",
    confused_with=("driver_gain", "supply_sag"),
    shown_by="full speed in both directions",
    check="Measure the voltage at the motor's terminals at full command: it stops at the limit.",
    advice="Look for a duty or current limit in the driver's settings.",
    nonlinear=True,
    runs_in="rtl",
    exports=row(
        own("actuator ctrlrange"),
        own("limit effort and velocity"),
        own("limit effort and velocity"),
        own("drive maxForce, maxJointVelocity"),
    ),
)
