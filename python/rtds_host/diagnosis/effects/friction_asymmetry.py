"""friction_asymmetry: -tau_a |sgn(w)| - b_a |w|."""

from rtds_host.diagnosis.conditions import one_way
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, left_out, own, row

# Of what a motor loses by its own back-EMF: friction that falls with speed falls by no more than there was, and a
# machine whose friction takes more than a fourth of its stall torque is none. Beyond, it would drive one way, and pass
# for any gain.
MOST_FALLING = 0.25

EFFECT = Effect(
    id="friction_asymmetry",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "torque_nm",
            "N·m",
            scale="torque",
            null=0,
            low=-2,
            high=2,
            prior_width=0.013,
            starts=(0.004, -0.004),
            meaning="half the difference of dry friction",
        ),
        Parameter(
            "nm_s_per_rad",
            "N·m·s/rad",
            scale="viscous",
            null=0,
            low=-MOST_FALLING,
            high=MOST_FALLING,
            prior_width=0.03,
            starts=(0.009, -0.009),
            meaning="half the difference of viscous friction",
        ),
    ),
    apply=add(asymmetry="torque_nm", asymmetry_viscous="nm_s_per_rad"),
    equation="-tau_a |sgn(w)| - b_a |w|",
    source="contract, section 3; A. Janot et al., Mech. Syst. Signal Process., 2017",
    confused_with=("coulomb_friction", "slope_error", "current_bias"),
    shown_by="the same speeds forwards and backwards",
    check="Turn the wheel in the air at the same slow speed both ways: the currents differ.",
    advice="Look for wear or preload on one flank of the gear; calibrate each direction.",
    separate=True,
    runs_in="rtl",
    form=0.02,
    compared_at={"torque_nm": 0.02, "nm_s_per_rad": 0.004},
    same_as={"coulomb_friction": one_way},
    friction=True,
    exports=row(
        own("actuator/general biasprm, where dry friction is at least as large; without its part by speed"),
        left_out("friction is the same in both directions"),
        left_out("friction is the same in both directions"),
        left_out("friction is the same in both directions"),
    ),
    exports_dcmotor=as_number(
        "actuator/general biasprm, where dry friction is at least as large; by speed driver module, "
        "by custom/numeric asymmetry_nm_s_per_rad"
    ),
)
