"""backlash: free play between gear and wheel, centred at the start."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add

EFFECT = Effect(
    id="backlash",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter("angle_rad", "rad", null=0, low=0, high=0.6, spread=0.04, starts=(0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.11, 0.16), difference=0.05,
                  meaning="total free play"),
    ),
    apply=add(backlash="angle_rad"),
    equation="free play between gear and wheel, centred at the start; inelastic contact",
    source="contract, section 3; M. Nordin, P.-O. Gutman, Automatica 38(10), 2002",
    confused_with=("gear_compliance", "command_delay"),
    shown_by="reversals and pseudo-random voltage",
    advice="Preload or replace the gear; avoid torque reversals at rest.",
    runs_in="robot",
    erratic=True,
)
