"""coulomb_friction: -tau sgn(w), sticking at rest."""

from rtds_host.diagnosis.conditions import no_current_no_reversal, one_way, same_load
from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import own, row

EFFECT = Effect(
    id="coulomb_friction",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "torque_nm",
            "N·m",
            scale="torque",
            null=0,
            low=0,
            high=2,
            prior_width=0.017,
            starts=(0.004, 0.025),
            meaning="dry friction, at the wheel",
        ),
    ),
    apply=add(coulomb="torque_nm"),
    equation="-tau sgn(w), sticking at rest",
    source="contract, section 3; B. Armstrong-Helouvry et al., Automatica 30(7), 1994",
    confused_with=("driver_deadzone", "bridge_drop", "rolling_resistance", "friction_asymmetry", "load_friction"),
    shown_by="crawl with reversals, coasting to rest",
    check=(
        "Turn the wheel in the air by a slow command and measure voltage and current: friction takes current as soon as"
        " it turns, a dead zone shows no voltage, and tyres play no part."
    ),
    advice="Grease or change the gear; feed the friction torque forward in the controller.",
    runs_in="rtl",
    form=0.02,
    same_as={
        "driver_deadzone": no_current_no_reversal,
        "bridge_drop": no_current_no_reversal,
        "friction_asymmetry": one_way,
        "rolling_resistance": same_load,
    },
    friction=True,
    exports=row(
        own("joint frictionloss"),
        own("dynamics friction"),
        own("dynamics/friction"),
        own("staticFrictionEffort, dynamicFrictionEffort"),
    ),
    resembles=(("torque", "w"),),
)
