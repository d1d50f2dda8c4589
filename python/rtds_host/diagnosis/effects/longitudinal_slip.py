"""longitudinal_slip: v_wheel = r w (1 - k F), F opposing where the wheel is driven by the ground."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add

EFFECT = Effect(
    id="longitudinal_slip",
    subsystem="wheel_ground",
    sided=True,
    parameters=(
        Parameter("slip_per_newton", "1/N", null=0, low=0, high=0.5, spread=0.02, starts=(0.005, 0.015, 0.05),
                  meaning="relative loss of speed a newton of traction"),
        Parameter("relaxation_m", "m", null=0.0, low=0.0, high=0.05, spread=0.003, starts=(0.0, 0.003),
                  optional=True, shape=True, meaning="rolling distance over which traction builds up; 0 = at once"),
    ),
    apply=add(slip="slip_per_newton", slip_relaxation="relaxation_m"),
    equation="v_wheel = r w (1 - k F), F opposing where the wheel is driven by the ground; traction builds up over the contact patch and is limited by grip",
    source="contract, section 3; H. B. Pacejka, Tire and Vehicle Dynamics, 2012, ch. 1 and 5",
    confused_with=("wheel_radius_error", "track_width_error"),
    shown_by="hill climbing with payload, pose measured",
    advice="Use tyres of higher stiffness, lower the load, or estimate the pose from outside.",
    runs_in="robot",
    axis=False,
    # A soft tyre with a long patch and a slippery one with a short one take much the same off a slow turn.
    restarts=({"slip_per_newton": 0.05, "relaxation_m": 0.0005},),
    form=0.15,
)
