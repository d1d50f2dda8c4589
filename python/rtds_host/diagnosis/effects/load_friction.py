"""load_friction: loss = c |torque at the gear's input| against the motion."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add
from rtds_host.diagnosis.effects.exported import as_number, left_out, row

EFFECT = Effect(
    id="load_friction",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "ratio",
            "1",
            null=0,
            low=0,
            high=0.95,
            prior_width=0.12,
            starts=(0.08, 0.3),
            meaning="share of the torque before the loss",
        ),
    ),
    apply=add(load_share="ratio"),
    equation="loss = c |torque at the gear's input| against the motion",
    source="contract, section 3; M. Duclusaud et al., ICRA 2025, arXiv 2410.08650",
    confused_with=("coulomb_friction", "torque_constant_error", "payload_error"),
    shown_by="hill climbing and descending with payload",
    check="Let the wheel lift a weight and lower it again, then twice the weight: the currents of lifting and "
    "lowering part more with more weight.",
    advice="Expect gear efficiency to fall with load; choose a gear of higher efficiency.",
    runs_in="rtl",
    form=0.02,
    compared_at={"ratio": 0.3},
    exports=row(*[left_out("friction there does not grow with the torque that a gear transmits")] * 4),
    resembles=(("torque", "load"),),
    exports_dcmotor=as_number(
        "driver module, by custom/numeric load_share: bound of the joint's dry friction, "
        "by the torque of the step before"
    ),
)
