"""longitudinal_slip: v_wheel = r w (1 - k F), F opposing where the wheel is driven by the ground."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import left_out, row
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.scales import Scales


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    slip = values["slip_per_newton"]
    model.add("slip", slip, sides)
    # Deflection and slip of one force: the length over which rolling takes the one for the other.
    model.add("slip_relaxation", values["softness_m_per_n"] / slip if slip > 0.0 else 0.0, sides)
    model.add("slip_damping", values["damping_n_s_per_m"], sides)
    model.put("slip_grip", values["grip"], sides)


def _soft_gear(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float] | None:
    """The spring of the tread as one between gear and wheel, what a traction at the rim is about the axle; behind one
    that is there already."""
    softness = values["softness_m_per_n"] / scales.radius**2 + (
        1.0 / existing["stiffness_nm_per_rad"] if existing else 0.0
    )
    if softness <= 0.0:
        return None
    return {
        "stiffness_nm_per_rad": 1.0 / softness,
        "damping_nm_s_per_rad": scales.radius**2 * values["damping_n_s_per_m"],
    }


CREEP = left_out("a contact creeps by force alone or slides, not by a share of the speed")

EFFECT = Effect(
    id="longitudinal_slip",
    subsystem="wheel_ground",
    sided=True,
    parameters=(
        Parameter(
            "slip_per_newton",
            "1/N",
            scale="give",
            null=0,
            low=0,
            high=2.5,
            prior_width=0.1,
            starts=(0.025, 0.075, 0.25),
            meaning="relative loss of speed a newton of traction",
        ),
        Parameter(
            "softness_m_per_n",
            "m/N",
            scale="softness",
            null=0.0,
            low=0.0,
            high=3.75,
            prior_width=0.01,
            starts=(0.003, 0.03),
            optional=True,
            shape=True,
            meaning="deflection of the tyre's tread a newton of traction; 0 = none",
        ),
        Parameter(
            "damping_n_s_per_m",
            "N·s/m",
            scale="tread",
            null=0.0,
            low=0.0,
            high=48.0,
            prior_width=1.9,
            starts=(2.4,),
            difference=0.05,
            optional=True,
            shape=True,
            meaning="of the tread that builds it up",
        ),
        Parameter(
            "grip",
            "1",
            null=1.0,
            low=0.4,
            high=40.0,
            prior_width=1.0,
            starts=(4.0,),
            difference=0.01,
            optional=True,
            shape=True,
            meaning="largest traction over the load on the wheel",
        ),
    ),
    apply=_apply,
    equation="v_wheel = r w (1 - k F0), F0 opposing where the wheel is driven by the ground and built up over a length "
    "of rolling; F = m tanh(F0 / m), m = grip times load",
    source="contract, section 3; H. B. Pacejka, Tire and Vehicle Dynamics, 2012, sections 7.2.1 and 8.6",
    confused_with=("wheel_radius_error", "track_width_error"),
    shown_by="hill climbing with payload, pose measured",
    check="Mark tyre and floor and drive ten wheel turns up a slope with payload, then on the level: under slip only "
    "the first way is short.",
    advice="Use tyres of higher stiffness, lower the load, or estimate the pose from outside.",
    nonlinear=True,
    runs_in="robot",
    axis=False,
    # A slippery tyre of a stiff tread and a soft one that hardly slides take much the same off a slow turn.
    restarts=(
        {"slip_per_newton": 0.25, "softness_m_per_n": 0.003, "damping_n_s_per_m": 2.4, "grip": 0.9},
        {"slip_per_newton": 0.025, "softness_m_per_n": 0.01, "damping_n_s_per_m": 2.4, "grip": 1.5},
    ),
    form=0.05,
    approximated_by={"gear_compliance": _soft_gear},
    # The length of rolling over which traction builds up: no fit found its way along its product with the slip, which
    # is what runs show.
    former={"relaxation_m": ("softness_m_per_n", "slip_per_newton")},
    compared_at={"slip_per_newton": 0.02, "softness_m_per_n": 6e-05, "damping_n_s_per_m": 50.0, "grip": 0.9},
    exports=row(
        CREEP,
        CREEP,
        CREEP,
        CREEP,
        left_out("its tyre builds up over a length of rolling and saturates; the module rolls without slip"),
    ),
)
