"""supply_sag: V = v_cmd bus / voltage_v, bus = voltage_v - R_s sum(i v_cmd / voltage_v)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands

EFFECT = Effect(
    id="supply_sag",
    subsystem="driver",
    sided=False,
    parameters=(
        Parameter(
            "resistance_ohm",
            "ohm",
            scale="ohm",
            null=0,
            low=0,
            high=2.5,
            prior_width=0.06,
            starts=(0.035, 0.12),
            meaning="resistance of supply and wiring",
        ),
    ),
    apply=add(source_resistance="resistance_ohm"),
    equation="V = v_cmd bus / voltage_v, bus = voltage_v - R_s sum(i v_cmd / voltage_v)",
    source="contract, section 3; averaged H-bridge: N. Mohan et al., Power Electronics, 2003, ch. 7",
    confused_with=("resistance_error", "driver_gain", "battery_decline"),
    shown_by="both motors loaded and braking, with v_bus logged",
    check=(
        "Measure the voltage at the driver's input while one motor is loaded by hand: it falls for both motors at once."
    ),
    advice="Measure the bus at the driver under load; use a stiffer supply, thicker leads or a bulk capacitor.",
    without_winding=False,
    runs_in="rtl",
    exports=map_of_commands("source_resistance_ohm"),
    resembles=(("voltage", "i"),),
    exports_dcmotor=as_number("driver module, by custom/numeric source_resistance_ohm"),
)
