"""viscous_friction: -b w, b down to minus the nominal B."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import own, row
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    for side in sides:
        # Friction cannot give energy back: not below minus the nominal B.
        floor = -model.get("viscous", side) * model.get("gear_ratio") ** 2
        model.add("viscous_wheel", max(values["nm_s_per_rad"], floor), (side,))


EFFECT = Effect(
    id="viscous_friction",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "nm_s_per_rad",
            "N·m·s/rad",
            scale="viscous",
            least="loss",
            null=0,
            low=-1,
            high=15,
            prior_width=0.045,
            starts=(0.015, 0.09, -0.024),
            meaning="beyond the nominal B, at the wheel",
        ),
    ),
    apply=_apply,
    equation="-b w, b down to minus the nominal B",
    source="contract, section 3",
    confused_with=("torque_constant_error", "load_friction"),
    shown_by="steady speeds with current logged",
    check="Turn the wheel in the air at two steady speeds: the current grows with the speed.",
    advice="Check the grease and its temperature; refit B.",
    runs_in="rtl",
    friction=True,
    exports=row(
        own("joint damping"), own("dynamics damping"), own("dynamics/damping"), own("viscousFrictionCoefficient")
    ),
    resembles=(("torque", "w"), ("damping", "t")),
)
