"""speed_filter: tau w_f' = w - w_f."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, add

EFFECT = Effect(
    id="speed_filter",
    subsystem="sensing",
    sided=True,
    parameters=(
        Parameter("time_constant_s", "s", null=0, low=0, high=2, spread=0.02, starts=(0.004, 0.03, 0.15),
                  meaning="first-order low-pass"),
    ),
    apply=add(speed_tau="time_constant_s"),
    equation="tau w_f' = w - w_f",
    source="contract, section 3",
    confused_with=("measurement_delay", "rotor_inertia_error"),
    shown_by="steps and pseudo-random voltage with angle or current",
    check="Compare the logged speed with the slope of the logged angle after a step: a filter rounds the speed and "
          "leaves the angle.",
    advice="Turn the driver's speed filter off, or model it in the controller.",
    seen_by=("w",),
    runs_in="signal",
    form=0.005,
)
