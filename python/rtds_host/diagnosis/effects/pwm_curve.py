"""pwm_curve: V = v_cmd (1 + c (1 - |v_cmd| / voltage_v))."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands

EFFECT = Effect(
    id="pwm_curve",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "curvature",
            "1",
            null=0,
            low=-1,
            high=10,
            prior_width=0.5,
            starts=(0.3, 1.0, -0.3),
            meaning="relative excess of voltage at the smallest duty",
        ),
    ),
    apply=add(pwm_curve="curvature"),
    scales=("command",),
    equation="V = v_cmd (1 + c (1 - |v_cmd| / voltage_v)): the right voltage at full duty, more (c > 0) or less below",
    source=(
        "contract, section 3; current that flows on in the off-time: R. W. Erickson, D. Maksimovic, Fundamentals of"
        " Power Electronics, 2001, chapter 5 (discontinuous conduction)"
    ),
    confused_with=("driver_gain", "driver_deadzone", "bridge_drop", "coulomb_friction"),
    shown_by="steady speeds at several voltages, small and large",
    check=(
        "Measure the voltage at the motor's terminals at 10, 30, 60 and 100 % of the command: its ratio to the "
        "command changes."
    ),
    advice="Measure the motor's voltage against the duty and invert the curve; or drive the bridge in slow decay.",
    runs_in="rtl",
    exports=map_of_commands("pwm_curve"),
    resembles=(("voltage", "v_cmd"),),
    exports_dcmotor=as_number("driver module, by custom/numeric pwm_curve"),
)
