"""driver_gain: V = ratio v_cmd."""

from rtds_host.diagnosis.conditions import speed_alone, torque_drives
from rtds_host.diagnosis.effects.base import Effect, Parameter, scale
from rtds_host.diagnosis.effects.exported import electrical, own

EFFECT = Effect(
    id="driver_gain",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=1,
            low=-5,
            high=5,
            prior_width=0.1,
            starts=(0.93, 1.07),
            meaning="voltage that reaches the motor over the command",
        ),
    ),
    apply=scale("voltage_gain"),
    scales=("command",),
    equation="V = ratio v_cmd",
    source="contract, section 3",
    confused_with=("speed_gain", "torque_constant_error", "supply_sag"),
    shown_by="steps with current and speed logged",
    check="Measure the voltage at the motor's terminals at several commands, wheel in the air: the ratio is off by "
    "the same factor at each.",
    advice="Measure the motor's voltage against the command; correct the supply's nominal value or the leads.",
    runs_in="rtl",
    same_as={"speed_gain": speed_alone},
    same_with_friction={"payload_error": torque_drives, "speed_gain": torque_drives},
    exports=electrical(),
    exports_dcmotor=own("actuator/dcmotor motorconst, resistance, inductance, gear"),
)
