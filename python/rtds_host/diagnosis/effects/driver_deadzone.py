"""driver_deadzone: V = v_cmd - sgn(v_cmd) min(|v_cmd|, v)."""

from rtds_host.diagnosis.conditions import no_current_no_reversal
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands

EFFECT = Effect(
    id="driver_deadzone",
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
            meaning="voltage lost between command and bridge",
        ),
    ),
    apply=add(deadzone="volts"),
    equation="V = v_cmd - sgn(v_cmd) min(|v_cmd|, v)",
    source=(
        "contract, section 3; dead time of a bridge: S.-G. Jeong, M.-H. Park, IEEE Trans. Ind. Electron. 38(2), 1991"
    ),
    confused_with=("bridge_drop", "coulomb_friction"),
    shown_by="crawl and reversals with current logged",
    check=(
        "Raise the command slowly from 0 and measure the motor's terminals: in a dead zone there is no voltage, "
        "under friction there is voltage and no motion."
    ),
    advice="Compensate the bridge's dead time in the driver, or raise its PWM resolution.",
    runs_in="rtl",
    same_as={"coulomb_friction": no_current_no_reversal, "bridge_drop": no_current_no_reversal},
    exports=map_of_commands("deadzone_v"),
    resembles=(("voltage", "v_cmd"),),
    exports_dcmotor=as_number("driver module, by custom/numeric deadzone_v"),
)
