"""speed_filter: tau w_f' = w - w_f, and what of the lag is a delay."""

from collections.abc import Mapping

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import as_number, reading
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.scales import Scales


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    lag = values["time_constant_s"]
    late = min(values["delay_s"], lag)
    model.add("speed_tau", lag - late, sides)
    model.add("speed_delay", late, sides)


def _all_delayed(
    values: Mapping[str, float], scales: Scales, existing: Mapping[str, float] | None = None
) -> dict[str, float]:
    """The lag as one of all that is measured, which the angle tells from it; after one that is there already."""
    return {"seconds": values["time_constant_s"] + (existing["seconds"] if existing else 0.0)}


EFFECT = Effect(
    id="speed_filter",
    subsystem="sensing",
    sided=True,
    parameters=(
        Parameter(
            "time_constant_s",
            "s",
            null=0,
            low=0,
            high=2,
            prior_width=0.02,
            starts=(0.004, 0.03, 0.15),
            meaning="lag of a first-order low-pass, a delay of the speed included",
        ),
        # A driver that counts over a fifth of a second is late by half of that; what is later comes over a link, with
        # all the rest.
        Parameter(
            "delay_s",
            "s",
            null=0,
            low=0,
            high=0.1,
            prior_width=0.02,
            starts=(0.0,),
            optional=True,
            shape=True,
            steep=True,
            meaning="what of this lag is a delay of the speed alone",
        ),
    ),
    apply=_apply,
    equation="reported(t) = w_f(t - d), (tau - d) w_f' = w - w_f",
    source="contract, section 3; a driver that takes its speed from counts over a span of time is late by half of that",
    confused_with=("measurement_delay", "rotor_inertia_error"),
    shown_by="steps and pseudo-random voltage with angle or current",
    check="Compare the logged speed with the slope of the logged angle after a step: a filter rounds the speed and "
    "leaves the angle.",
    advice="Turn the driver's speed filter off, or model it in the controller.",
    seen_by=("w",),
    runs_in="signal",
    form=0.005,
    approximated_by={"measurement_delay": _all_delayed},
    compared_at={"time_constant_s": 0.03, "delay_s": 0.0126},
    exports=reading("speed_filter_s; sensor delay: what of its lag is a delay"),
    resembles=(("speed_sensor", "w"),),
    exports_dcmotor=as_number(
        "driver module, by custom/numeric speed_filter_s; sensor delay: what of its lag is a delay"
    ),
)
