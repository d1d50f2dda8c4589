"""pwm_curve: V = v_cmd (1 + c (1 - |v_cmd| / voltage_v)), or what a bridge in fast decay gives with the load."""

import math
from collections.abc import Mapping
from functools import lru_cache

from scipy.optimize import brentq

from rtds_host.diagnosis.effects.base import Effect, Parameter
from rtds_host.diagnosis.effects.exported import as_number, map_of_commands
from rtds_host.diagnosis.replay.model import Model

# The voltage of a bridge in fast decay depends on duty cycle and load. Its curvature is that of the curve that gives as
# much at a quarter of the full duty and at the current of a gear motor without load: 3 % of the stall current, as data
# sheets have it. A convention of what the number means. Its lowest value, -1, is a period of 0.6 L / R: with a shorter
# one the current hardly ever dies out.
DUTY, NO_LOAD = 0.25, 0.03
# Numerical: bounds of a PWM period over the electrical time constant, and how near to the largest voltage one comes.
SHORTEST, LONGEST, CLOSEST = 1e-3, 1e3, 1e-3


@lru_cache(maxsize=4096)
def periods(curvature: float) -> float:
    """PWM period over L / R of a bridge in fast decay with a curvature: `plant.driver.fast_decay`, solved for it."""
    emf = min(max(DUTY * (1.0 + curvature * (1.0 - DUTY)) - NO_LOAD, 0.0), 1.0 - NO_LOAD / DUTY - CLOSEST)
    falls = (DUTY * (1.0 - emf) - NO_LOAD) / (1.0 + emf)

    def excess(x: float) -> float:
        return falls * x - math.log1p((1.0 - emf) * -math.expm1(-DUTY * x) / (1.0 + emf))

    return float(brentq(excess, SHORTEST, LONGEST))


def _apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
    model.add("pwm_curve", values["curvature"], sides)
    if values["fast_decay"]:
        model.put("fast_decay", values["fast_decay"], sides)
        model.put("pwm_periods", periods(values["curvature"]), sides)


EFFECT = Effect(
    id="pwm_curve",
    subsystem="driver",
    sided=True,
    parameters=(
        Parameter(
            "curvature",
            "1",
            null=0,
            low=-1,
            high=10,
            prior_width=0.5,
            starts=(0.3, 1.0, -0.3),
            meaning="relative excess of voltage at the smallest duty",
        ),
        Parameter(
            "fast_decay",
            "1",
            null=0,
            low=0,
            high=2,
            prior_width=0.5,
            starts=(0.0, 1.0),
            optional=True,
            shape=True,
            switch=True,
            bench=True,
            meaning="share of a bridge in fast decay, whose voltage falls with the load: 1 is such a bridge",
        ),
    ),
    apply=_apply,
    scales=("command",),
    equation="V = v_cmd (1 + c (1 - |v_cmd| / voltage_v)): the right voltage at full duty, more (c > 0) or less below;"
    " with a share s of fast decay V + s (F - V), F the mean over a period of the bus, minus the bus until the current"
    " is zero, and then the back EMF",
    source=(
        "contract, section 3; current that flows on in the off-time: R. W. Erickson, D. Maksimovic, Fundamentals of"
        " Power Electronics, 2001, chapter 5 (discontinuous conduction)"
    ),
    confused_with=("driver_gain", "driver_deadzone", "bridge_drop", "coulomb_friction"),
    shown_by="steady speeds at several voltages, small and large",
    check=(
        "Measure the voltage at the motor's terminals at 10, 30, 60 and 100 % of the command: its ratio to the "
        "command changes."
    ),
    advice="Measure the motor's voltage against the duty and invert the curve; or drive the bridge in slow decay.",
    runs_in="rtl",
    agrees_within=(0.2, "in fast decay the voltage follows the speed, which the simulator takes once a millisecond"),
    exports=map_of_commands("pwm_curve"),
    resembles=(("voltage", "v_cmd"),),
    exports_dcmotor=as_number("driver module, by custom/numeric pwm_curve"),
)
