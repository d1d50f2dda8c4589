"""rotor_inertia_error: J = ratio J_nominal."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, scale

EFFECT = Effect(
    id="rotor_inertia_error",
    subsystem="drivetrain",
    sided=True,
    parameters=(
        Parameter("ratio", "1", null=1, low=0.05, high=10, spread=0.2, starts=(0.85, 1.2),
                  meaning="J over its nominal value"),
    ),
    apply=scale("rotor_inertia"),
    equation="J = ratio J_nominal",
    source="contract, section 3",
    confused_with=("command_delay", "measurement_delay", "payload_error"),
    shown_by="steps and pseudo-random voltage",
    advice="Identify J from a step response at no load.",
    runs_in="rtl",
    nuisance=True,
)
