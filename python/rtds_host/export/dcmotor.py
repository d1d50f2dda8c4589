"""MuJoCo's `<dcmotor>` for a wheel: winding, heat, cogging and LuGre friction in one element (MuJoCo 3.7 or later).

The element knows one constant K for torque and voltage and no gain of a driver. A motor with Km, Kb, a gain g and a
winding R, L is the same to its wheel as one with

    K = Kb / |g|,  R' = R Kb / (Km g²),  L' = L Kb / (Km g²),  gear = N sgn(g),

whose current is i' = i Km |g| / Kb: torque N Km i and back EMF of the commanded volt are then those of the motor. The
two are equal, element and data sheet, where Km = Kb and g = 1. Equations: MuJoCo, "DC Motor Model", sections 1 and 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtds_host.export.figures import Figures, Side

# s; a winding's current is exact over a step, but the speed whose back EMF it sees is the one before it.
TIMESTEP_S = 2.5e-4
# Resistance of copper by temperature, 1/K: gives the winding's rise a temperature.
COPPER_PER_K = 3.93e-3
# LuGre's bristle bends by so much at the wheel before it slips, or by more where its swing with the rotor would be too
# fast for the step. It may bend by less as long as the back EMF damps its swing: MuJoCo steps a bristle by explicit
# Euler, which adds k h to a swing's damping c, negative, so that one stiffer than c/h rattles and creeps at rest.
BRISTLE_RAD, BRISTLE_SWING, BRISTLE_DAMPED = 1e-4, 0.3, 0.8
# Numbers of the cogging, in its order, and of its second harmonic.
COGGING = ("ripple_nm", "ripple_cycles", "ripple_phase_rad")
SECOND = ("ripple_in_phase", "ripple_in_quadrature")
# V; of a driver that answers nothing: MuJoCo wants a range.
NOTHING_V = 1e-9


@dataclass(frozen=True)
class Element:
    """A `<dcmotor>`, SI, at the motor's shaft. `current_per_activation`: ampere of the motor for one of the
    element's."""

    resistance_ohm: float
    inductance_h: float
    constant: float
    gear: float
    thermal_k_per_w: float
    thermal_s: float
    cogging: tuple[float, float, float]
    lugre: tuple[float, float, float, float]
    current_per_activation: float
    top_v: float


def second_harmonic(side: Side) -> tuple[float, float, float]:
    """The second harmonic of a side's ripple as a cogging of its own at the wheel: N·m, cycles a turn, phase in rad."""
    size_nm, cycles, phase = (side.torques[name] for name in COGGING)
    in_phase, in_quadrature = (side.torques[name] for name in SECOND)
    return (
        size_nm * math.hypot(in_phase, in_quadrature),
        2.0 * cycles,
        2.0 * phase + math.atan2(in_quadrature, in_phase),
    )


def element(figures: Figures, side: Side) -> Element:
    """The element of one side.

    LuGre's numbers are stiffness, Coulomb and static friction and Stribeck's speed; its bristle has no damping of its
    own, which would lag behind the speed.
    """
    n, gain = figures.gear_ratio, side.voltage_gain
    torque, voltage = side.gear_nm_per_a / n, side.back_emf_v_s_per_rad / n
    size = abs(gain) if gain else 1.0
    scale = voltage / (torque * size**2)
    turn = n * math.copysign(1.0, gain)
    level = side.dry_nm + side.stribeck_nm
    stiffest = (BRISTLE_SWING / TIMESTEP_S) ** 2 * (side.rotor_kg_m2 + figures.body.wheel_inertia_kg_m2)
    lugre = (0.0, 0.0, 0.0, 0.0)
    if side.stribeck_nm:
        damped = BRISTLE_DAMPED * (side.braking + side.viscous_nm_s_per_rad) / TIMESTEP_S
        stiffness = min(max(level / BRISTLE_RAD, damped), stiffest)
        lugre = (stiffness / n**2, side.dry_nm / n, level / n, side.stribeck_rad_s * n)
    size_nm, cycles, phase = (side.torques[name] for name in COGGING)
    cogging = (size_nm / n, cycles / n, math.copysign(1.0, gain) * phase)
    return Element(
        resistance_ohm=side.resistance_ohm * scale,
        inductance_h=side.inductance_h * scale,
        constant=voltage / size,
        gear=turn,
        # The element's heat is i'² R' = i² R Km / Kb.
        thermal_k_per_w=side.heat_rise_per_w * voltage / torque / COPPER_PER_K,
        thermal_s=side.heat_tau_s,
        cogging=cogging,
        lugre=lugre,
        current_per_activation=voltage / (torque * size) * math.copysign(1.0, gain),
        top_v=figures.limit_v(side) if gain else NOTHING_V,
    )


def text(name: str, delay: str, motor: Element) -> str:
    """The element's line; `delay`: attributes of a delay."""
    more = ""
    if motor.thermal_k_per_w:
        more += f' thermal="{motor.thermal_k_per_w:.9g} 0 {motor.thermal_s:.9g} {COPPER_PER_K:g} 25 25"'
    if motor.cogging[0]:
        more += ' cogging="{:.9g} {:.9g} {:.9g}"'.format(*motor.cogging)
    if motor.lugre[0]:
        more += ' lugre="{:.9g} 0 {:.9g} {:.9g} {:.9g}"'.format(*motor.lugre)
    return (
        f'    <dcmotor name="motor_{name}" joint="wheel_{name}" gear="{motor.gear:.9g}" ctrllimited="true" '
        f'ctrlrange="{-motor.top_v:.9g} {motor.top_v:.9g}"{delay} '
        f'motorconst="{motor.constant:.9g} {motor.constant:.9g}" resistance="{motor.resistance_ohm:.9g}" '
        f'inductance="{motor.inductance_h:.9g} 0"{more}/>\n'
    )
