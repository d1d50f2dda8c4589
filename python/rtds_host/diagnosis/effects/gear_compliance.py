"""gear_compliance: T = k (th_gear - th_wheel) + d (w_gear - w_wheel)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put

EFFECT = Effect(
    id="gear_compliance",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter("stiffness_nm_per_rad", "N·m/rad", scale="torque", null=85, low=0.02, high=2000, spread=12.5,
                  starts=(0.15, 0.3, 0.64, 1.3, 2.5, 5.0, 10.6, 25.0),
                  meaning="spring between gear and wheel"),
        Parameter("damping_nm_s_per_rad", "N·m·s/rad", scale="viscous", null=0.0, low=0, high=15, spread=0.03, starts=(0.03, 0.09),
                  shape=True, meaning="its damping"),
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
    runs_in="robot",
)
