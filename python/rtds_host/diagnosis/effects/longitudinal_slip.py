"""longitudinal_slip: v_wheel = r w (1 - k F), F opposing where the wheel is driven by the ground."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.replay.model import Model


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    model.add("slip", values["slip_per_newton"], sides)
    model.add("slip_relaxation", values["relaxation_m"], sides)
    model.add("slip_damping", values["damping_n_s_per_m"], sides)
    model.put("slip_grip", values["grip"], sides)


EFFECT = Effect(
    id="longitudinal_slip",
    subsystem="wheel_ground",
    sided=True,
    parameters=(
        Parameter("slip_per_newton", "1/N", scale="give", null=0, low=0, high=2.5, spread=0.1, starts=(0.025, 0.075, 0.25),
                  meaning="relative loss of speed a newton of traction"),
        Parameter("relaxation_m", "m", scale="radius", null=0.0, low=0.0, high=1.5, spread=0.09, starts=(0.0, 0.09),
                  optional=True, shape=True, meaning="rolling distance over which traction builds up; 0 = at once"),
        Parameter("damping_n_s_per_m", "N·s/m", scale="tread", null=0.0, low=0.0, high=48.0, spread=1.9, starts=(2.4,),
                  difference=0.05, optional=True, shape=True, meaning="of the tread that builds it up"),
        Parameter("grip", "1", null=0.9, low=0.4, high=4.0, spread=0.3, starts=(0.9,), difference=0.03,
                  optional=True, shape=True, meaning="largest traction over the load on the wheel"),
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
    # A soft tyre with a long patch and a slippery one with a short one take much the same off a slow turn.
    restarts=({"slip_per_newton": 0.25, "relaxation_m": 0.015, "damping_n_s_per_m": 2.4, "grip": 0.9},
              {"slip_per_newton": 0.025, "relaxation_m": 0.36, "damping_n_s_per_m": 2.4, "grip": 1.5}),
    form=0.05,
)
