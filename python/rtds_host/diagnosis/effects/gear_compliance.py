"""gear_compliance: T = k (th_gear - th_wheel) + d (w_gear - w_wheel)."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter, put
from rtds_host.diagnosis.effects.exported import RIGID, left_out, own, row
from rtds_host.diagnosis.scales import Scales


def _soft_tyre(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float]:
    """The spring as one of the tyre's tread; behind one that is there already."""
    softness = scales.radius**2 / values["stiffness_nm_per_rad"] + (existing["softness_m_per_n"] if existing else 0.0)
    return {
        **(existing or {}),
        "softness_m_per_n": softness,
        "damping_n_s_per_m": values["damping_nm_s_per_rad"] / scales.radius**2,
    }


EFFECT = Effect(
    id="gear_compliance",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter(
            "stiffness_nm_per_rad",
            "N·m/rad",
            scale="torque",
            null=85,
            low=0.02,
            high=2000,
            prior_width=12.5,
            starts=(0.15, 0.3, 0.64, 1.3, 2.5, 5.0, 10.6, 25.0),
            meaning="spring between gear and wheel",
        ),
        Parameter(
            "damping_nm_s_per_rad",
            "N·m·s/rad",
            scale="viscous",
            null=0.0,
            low=0,
            high=15,
            prior_width=0.03,
            starts=(0.03, 0.09),
            shape=True,
            meaning="its damping",
        ),
    ),
    apply=put(stiffness="stiffness_nm_per_rad", damping="damping_nm_s_per_rad"),
    equation="T = k (th_gear - th_wheel) + d (w_gear - w_wheel)",
    source="contract, section 3; M. W. Spong, J. Dyn. Syst. 109(4), 1987",
    confused_with=("backlash", "speed_filter"),
    shown_by="steps and pseudo-random voltage",
    check="Hold the motor's shaft still and pull at the wheel's rim: a soft gear gives in proportion to the force "
    "and springs back, free play does not.",
    advice="Stiffen the coupling, or filter the command above its resonance.",
    nonlinear=True,
    rough=True,
    approximated_by={"longitudinal_slip": _soft_tyre},
    # Hooke's law, but not of the gear alone: a tyre, a shaft and a wheel of a hundred times its stiffness give in a row
    # with it.
    form=0.01,
    gives=True,
    runs_in="robot",
    exports=row(
        own("a second hinge with stiffness and damping"),
        RIGID,
        RIGID,
        RIGID,
        left_out("its gear is rigid"),
    ),
)
