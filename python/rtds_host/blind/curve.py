"""Laws that are drawn at random: a curve over a state in one equation of the planar world.

A diagnoser cannot know them, since nobody wrote them down. Their shape is a sample of a Gaussian process (C. E.
Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, chapter 2), or of a Fourier series over
a turn.
Friction takes energy out, and nothing acts on a robot that rests.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

POINTS = 33
# Columns of a curve: its law (0: none), the ends of its grid, and its values from there on.
LAW, LOW, HIGH, VALUES = range(4)
WIDTH = VALUES + POINTS
LENGTHS = (0.2, 0.6)  # over which a curve keeps its direction, share of its range
HARMONICS = 4  # of a turn
FRICTION = (
    "coulomb_friction",
    "stribeck_friction",
    "viscous_friction",
    "friction_asymmetry",
    "load_friction",
    "rolling_resistance",
)
DRIVER = ("driver_gain", "driver_deadzone", "bridge_drop", "pwm_curve", "voltage_limit", "resistance_error")
# Law -> equation, quantity, where it lies, and the effects whose name a diagnoser may give it: those of its equation.
LAWS = {
    "voltage_over_command": ("voltage", "v_cmd", "driver", DRIVER),
    "voltage_over_current": ("voltage", "i", "driver", DRIVER),
    "flux_over_current": ("torque_constant", "i", "winding", ("torque_constant_error",)),
    "torque_over_speed": ("torque", "w", "drivetrain", FRICTION),
    "torque_over_angle": ("torque", "th", "drivetrain", ("torque_ripple",)),
    "damping_over_time": ("damping", "t", "drivetrain", FRICTION),
    "yaw_torque_over_yaw_rate": ("yaw_torque", "yaw_rate", "wheel_ground", ("spin_scrub",)),
    "force_over_speed": ("force", "speed", "wheel_ground", FRICTION),
    "force_over_place": ("force", "x", "wheel_ground", ("slope_error", "rolling_resistance")),
    "speed_over_speed": ("speed_sensor", "w", "sensing", ("speed_gain",)),
    "current_over_current": ("current_sensor", "i", "sensing", ("current_gain", "current_bias")),
    "gyro_over_yaw_rate": ("gyro_sensor", "yaw_rate", "sensing", ("gyro_gain", "gyro_bias")),
}
CODES = {law: k for k, law in enumerate(LAWS, 1)}
(
    VOLTAGE_COMMAND,
    VOLTAGE_CURRENT,
    FLUX,
    TORQUE_SPEED,
    TORQUE_ANGLE,
    DAMPING_TIME,
    YAW_TORQUE,
    FORCE_SPEED,
    FORCE_PLACE,
    SPEED_READING,
    CURRENT_READING,
    GYRO_READING,
) = CODES.values()
# Laws that only take energy out, and those of the body as a whole.
PASSIVE = ("voltage_over_current", "torque_over_speed", "yaw_torque_over_yaw_rate", "force_over_speed")
WHOLE = ("yaw_torque_over_yaw_rate", "force_over_speed", "force_over_place", "gyro_over_yaw_rate")


def no_curves() -> np.ndarray:
    """Curves (2, WIDTH), one a side, of a machine without any; those of the body stand on the left."""
    return np.zeros((2, WIDTH))


@njit(cache=True)
def at(row, x):
    """Value of a curve (WIDTH,) at x: straight between its points, and its last value beyond them."""
    span = row[HIGH] - row[LOW]
    if row[LAW] == TORQUE_ANGLE:
        x = row[LOW] + (x - row[LOW]) % span
    place = (x - row[LOW]) / span * (POINTS - 1)
    if place <= 0.0:
        return row[VALUES]
    if place >= POINTS - 1:
        return row[VALUES + POINTS - 1]
    k = int(place)
    return row[VALUES + k] + (place - k) * (row[VALUES + k + 1] - row[VALUES + k])


def reading(row: np.ndarray, law: int, values: np.ndarray) -> np.ndarray:
    """What a sensor with a curve reads of values (n,); as they are where the curve is another law's."""
    if row[LAW] != law:
        return values
    return values + np.interp(values, np.linspace(row[LOW], row[HIGH], POINTS), row[VALUES:])


def draw_shape(rng: np.random.Generator, law: str, low: float, high: float) -> np.ndarray:
    """A random curve (POINTS,) over a range, 1 at its largest; 0 where its quantity is 0, but for an angle's and a
    place's."""
    x = np.linspace(low, high, POINTS)
    if law == "torque_over_angle":
        waves = np.arange(1, HARMONICS + 1)
        sizes, phases = rng.standard_normal(HARMONICS) / np.sqrt(waves), rng.uniform(0.0, 2.0 * math.pi, HARMONICS)
        shape = (sizes * np.sin(np.outer(x, waves) + phases)).sum(axis=1)
    else:
        shape = _smooth(rng, np.abs(x) if law == "flux_over_current" else x, high - low, law != "force_over_place")
        if law in PASSIVE:
            shape = -np.sign(x) * shape**2
        elif law == "damping_over_time":
            shape = shape**2
    return shape / np.abs(shape).max()


def _smooth(rng: np.random.Generator, x: np.ndarray, span: float, from_zero: bool) -> np.ndarray:
    """A sample of a Gaussian process at x (n,), which is 0 at 0 where `from_zero`."""
    length = rng.uniform(*LENGTHS) * span

    def alike(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * np.square((a[:, None] - b[None, :]) / length))

    covariance = alike(x, x)
    if from_zero:
        zero = alike(x, np.zeros(1))
        covariance = covariance - zero @ zero.T
    values, vectors = np.linalg.eigh(covariance)
    return vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(x.size))
