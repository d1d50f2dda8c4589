"""gear_compliance: T = k (th_gear - th_wheel) + d (w_gear - w_wheel)."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put

EFFECT = Effect(
    id="gear_compliance",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter("stiffness_nm_per_rad", "N·m/rad", null=200, low=0.05, high=5000, spread=30, starts=(0.35, 0.7, 1.5, 3.0, 6.0, 12.0, 25.0, 60.0),
                  meaning="spring between gear and wheel"),
        Parameter("damping_nm_s_per_rad", "N·m·s/rad", null=0.0, low=0, high=5, spread=0.01, starts=(0.01, 0.03),
                  shape=True, meaning="its damping"),
    ),
    apply=put(stiffness="stiffness_nm_per_rad", damping="damping_nm_s_per_rad"),
    equation="T = k (th_gear - th_wheel) + d (w_gear - w_wheel)",
    source="contract, section 3; M. W. Spong, J. Dyn. Syst. 109(4), 1987",
    confused_with=("backlash", "speed_filter"),
    shown_by="steps and pseudo-random voltage",
    advice="Stiffen the coupling, or filter the command above its resonance.",
    runs_in="robot",
)
