"""Forms: terms of the equations that have no name, as curves over a quantity of the replay.

A form is one row of `WIDTH` numbers: which term it adds to, over which quantity, the ends of its grid, the time
constant of a heat, and its values at the points of a grid. A robot has up to `MOST_FORMS` of them a side. Three grids
serve (`BRANCHES`, `PERIODIC`, even). Between the points a curve is straight, beyond its ends it holds its last value. A
piecewise linear curve is a spline of degree one: C. de Boor, "A Practical Guide to Splines", 2001, chapter 3.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.plant.compiled import allocation_free, law, loop

# Numerical: points of a curve, of one of two branches, and forms a side. Branches have more: what a formula says of a
# jump lies between two of them.
POINTS = 14
HALF = 49
MOST_FORMS = 3
# Columns of a form's row: its term, what it runs over, the ends of its grid, the time constant of its heat, s, and its
# values from there on.
TERM, OVER, LOW, HIGH, TAU, VALUES = range(6)
WIDTH = VALUES + 2 * HALF

# Rows are arrays or lists: exports have the same functions in plain Python (`rtds_host.export.python`).
# Terms, from 1 (0: no form), with their units. Torques are at the wheel and drive forwards; `voltage` is at the nominal
# bus behind the driver; `torque_constant` is relative, and the back-EMF changes by the same share; sensors add to what
# is reported; `damping` adds to the coefficient that the wheel's speed is multiplied with, against the motion.
TERMS = {
    "torque": "N·m",
    "voltage": "V",
    "torque_constant": "1",
    "force": "N",
    "yaw_torque": "N·m",
    "current_sensor": "A",
    "speed_sensor": "rad/s",
    "gyro_sensor": "rad/s",
    "damping": "N·m·s/rad",
}
# What a form can run over, from 1, with its unit. `motor_angle` is the wheel's angle times the gear ratio.
# `command_history` is the command's size, negative once it has fallen back from its last extreme; the term then acts
# along the command. `load` is the torque that the gear delivers to the wheel; a torque over it is friction, and runs
# over the load in the direction of motion: negative where the wheel drives the motor. `heat` is the square of the
# side's current through a filter of first order, nothing as a run begins: each form over it has a time constant of its
# own. A voltage over it is a share of the command, and a torque over it friction.
OVERS = {
    "v_cmd": "V",
    "command_history": "V",
    "i": "A",
    "w": "rad/s",
    "load": "N·m",
    "yaw_rate": "rad/s",
    "th": "rad",
    "motor_angle": "rad",
    "speed_yaw_rate": "m/s·rad/s",
    "speed": "m/s",
    "t": "s",
    "x": "m",
    "y": "m",
    "yaw": "rad",
    "heat": "A²",
}
TERM_CODE = {name: k + 1 for k, name in enumerate(TERMS)}
OVER_CODE = {name: k + 1 for k, name in enumerate(OVERS)}
# Two branches that meet in a jump at zero, where friction, dead zones and bridges have one; values run from -high to
# -0 and from +0 to high.
BRANCHES = ("v_cmd", "command_history", "i", "w", "load", "yaw_rate")
# A full turn, whose end is its beginning.
PERIODIC = ("th", "motor_angle", "yaw")
FULL_TURN = 2.0 * math.pi
_LAST_BRANCH, _FIRST_TURN, _LAST_TURN = len(BRANCHES), OVER_CODE["th"], OVER_CODE["motor_angle"]
_TORQUE, _VOLTAGE, _CONSTANT, _FORCE, _YAW = (
    TERM_CODE[name] for name in ("torque", "voltage", "torque_constant", "force", "yaw_torque")
)
_V, _HISTORY, _I, _W, _LOAD, _RATE, _HEADING, _TIME, _HEAT, _X, _Y = (
    OVER_CODE[name] for name in ("v_cmd", "command_history", "i", "w", "load", "yaw_rate", "yaw", "t", "heat", "x", "y")
)
_FIRST_READ, _GYRO, _DAMPING = (TERM_CODE[name] for name in ("current_sensor", "gyro_sensor", "damping"))
# What the forms of a side come to in a step: torque that drives; levels of dry friction against turning forwards and
# backwards; friction by speed, N·m·s/rad; voltage; relative torque constant; force; torque about the vertical; and its
# part against the yaw rate that can hold the robot.
DRIVE, FORWARD, BACKWARD, FLUID, VOLTS, CONSTANT, PUSH, TURN, SCRUB = range(9)
ACTS = 9
# Numerical: how many quantities a form may run over, and one more: the mean current of the step, A, which all but a
# voltage run over. A voltage over the current is part of what makes that mean. Heats are what a side remembers.
ABOUT = len(OVERS) + 1
MEAN_I = len(OVERS)
# What a side's forms remember: the command's last extreme, V; 1 while its size grows, -1 once it has fallen back, 0
# before the first command; the load, N·m; and the heat of each form, A².
EXTREME, DIRECTION, GEAR_LOAD, HEATS = range(4)
PAST = HEATS + MOST_FORMS
# Share of a curve's range by which a command has to come back from an extreme to count as turned: the dither of a
# controller is no turn.
TURNS_BY = 0.01
# Time constant, s, with which the load follows the gear's torque. That torque and the friction that hangs on it each
# give the other; with a lag no equation has to be solved for both, and steps of different lengths agree.
LOAD_S = 0.01


def no_forms() -> np.ndarray:
    """Rows (2, `MOST_FORMS`, `WIDTH`) of a robot without a form."""
    return np.zeros((2, MOST_FORMS, WIDTH))


def units_of(term: str, over: str) -> tuple[str, str]:
    """Units of what a form runs over, and of its value: a voltage over the heat is a share of the command."""
    return OVERS[over], "1" if (term, over) == ("voltage", "heat") else TERMS[term]


def values_in(row: np.ndarray) -> np.ndarray:
    """The values of a form's row (WIDTH,), one a point of its grid."""
    return row[VALUES : VALUES + (2 * HALF if row[OVER] <= _LAST_BRANCH else POINTS)]


@law
def curve(row, x):
    """Value and slope of a form at x; at a jump's place it is zero, with no slope.

    row : (WIDTH,), see the module; x : in the unit of what it runs over. Returns the value in the term's unit.
    """
    over, low, high = row[OVER], row[LOW], row[HIGH]
    if over <= _LAST_BRANCH:
        if x == 0.0 or high <= 0.0:
            return 0.0, 0.0
        return branch(row, x > 0.0, abs(x))
    span = high - low
    if span <= 0.0:
        return row[VALUES], 0.0
    if _FIRST_TURN <= over <= _LAST_TURN or over == _HEADING:
        per = POINTS / span
        at = (x - low) * per
        at -= math.floor(at / POINTS) * POINTS
        k = int(at)
        if k >= POINTS:
            k = POINTS - 1
        a = row[VALUES + k]
        b = row[VALUES + k + 1] if k + 1 < POINTS else row[VALUES]
        return a + (b - a) * (at - k), (b - a) * per
    per = (POINTS - 1) / span
    at = (x - low) * per
    if at <= 0.0:
        return row[VALUES], 0.0
    if at >= POINTS - 1:
        return row[VALUES + POINTS - 1], 0.0
    k = int(at)
    a, b = row[VALUES + k], row[VALUES + k + 1]
    return a + (b - a) * (at - k), (b - a) * per


@law
def branch(row, positive, size):
    """Value and slope (by x) of one branch of a form at a size of x, 0 included: the value next to the jump."""
    per = (HALF - 1) / row[HIGH]
    at = size * per
    first = VALUES + HALF if positive else VALUES + HALF - 1
    way = 1 if positive else -1
    if at >= HALF - 1:
        return row[first + way * (HALF - 1)], 0.0
    k = int(at)
    a, b = row[first + way * k], row[first + way * (k + 1)]
    return a + (b - a) * (at - k), (b - a) * per * way


@law
def act(rows, quantities, past, acts):
    """What a side's forms come to.

    Parameters
    ----------
    rows : (MOST_FORMS, WIDTH). quantities : (ABOUT,) of this side now, in the order of `OVERS`, and the mean current.
    past : (PAST,) what they remember.
    acts : (ACTS,) filled: torque N·m, levels of dry friction N·m, friction by speed N·m·s/rad, voltage V, relative
        torque constant, force N, torque about the vertical N·m and its part against the yaw rate N·m.

    A force over x or y pushes along that axis, as the slope of an uneven floor does. What is across the robot's way its
    wheels hold.

    A torque over the wheel's speed is dry friction with a level for each direction: it can hold a wheel. By its slope
    it also goes into the friction by speed, so that long steps stay stable. A torque over the load is dry friction,
    too: turning forwards the load drives with one sign, turning backwards with the other. A torque over the heat is
    dry friction that is alike in both directions.
    """
    for n in range(ACTS):
        acts[n] = 0.0
    for n in range(MOST_FORMS):
        if rows[n][TERM] == 0.0:
            continue
        row = rows[n]
        term, over = int(row[TERM]), int(row[OVER])
        if over == _HEAT:
            x = past[HEATS + n]
        else:
            x = quantities[MEAN_I if over == _I and term != _VOLTAGE else over - 1]
        value, slope = curve(row, x)
        if over == _HISTORY and quantities[_V - 1] < 0.0:
            value = -value
        if term == _TORQUE and over == _LOAD:
            acts[FORWARD] -= value
            acts[BACKWARD] -= curve(row, -x)[0]
        elif term == _TORQUE and over == _HEAT:
            acts[FORWARD] -= value
            acts[BACKWARD] -= value
        elif term == _TORQUE and over == _W:
            ahead = value if x > 0.0 else branch(row, True, 0.0)[0]
            back = value if x < 0.0 else branch(row, False, 0.0)[0]
            acts[FORWARD] -= ahead
            acts[BACKWARD] += back
            acts[FLUID] -= slope
            acts[DRIVE] -= slope * x
        elif term == _TORQUE:
            acts[DRIVE] += value
        elif term == _VOLTAGE:
            acts[VOLTS] += value * quantities[_V - 1] if over == _HEAT else value
        elif term == _DAMPING:
            acts[FLUID] += value
        elif term == _CONSTANT:
            acts[CONSTANT] += value
        elif term == _FORCE and over == _X:
            acts[PUSH] += value * math.cos(quantities[_HEADING - 1])
        elif term == _FORCE and over == _Y:
            acts[PUSH] += value * math.sin(quantities[_HEADING - 1])
        elif term == _FORCE:
            acts[PUSH] += value
        elif term == _YAW and over == _RATE:
            ahead, back = -branch(row, True, 0.0)[0], branch(row, False, 0.0)[0]
            level = -value if x > 0.0 else (value if x < 0.0 else max(ahead, back))
            acts[SCRUB] += max(level, 0.0)
            # What drives the turn holds nothing.
            acts[TURN] += value if level < 0.0 and x != 0.0 else 0.0
        elif term == _YAW:
            acts[TURN] += value


@allocation_free
def back_emf(acts, constant, speed):
    """Voltage at the nominal bus by which the back-EMF is smaller where forms change the torque constant, V.

    acts : (ACTS,) as `act` fills it; constant : V·s/rad and speed : rad/s, both at the wheel. Torque a current and
    back-EMF a speed are one constant: what a motor takes up it gives off (P. C. Krause et al., "Analysis of Electric
    Machinery and Drive Systems", 2013, chapter 2).
    """
    return -acts[CONSTANT] * constant * speed


@allocation_free
def follow(rows, volts, past):
    """Follow a command through its turns: whether its size grows, or has fallen back from an extreme.

    rows : (MOST_FORMS, WIDTH) of a side; volts : V, the command now in force, clipped; past : (PAST,), changed. A
    second call with the same command changes nothing. The direction of the last change is the simplest state of a
    hysteresis with two branches (I. D. Mayergoyz, "Mathematical Models of Hysteresis", 1991, chapter 1).
    """
    slack = -1.0
    for n in range(MOST_FORMS):
        if rows[n][TERM] != 0.0 and rows[n][OVER] == _HISTORY:
            slack = max(slack, TURNS_BY * rows[n][HIGH])
    if slack < 0.0:
        return
    size, extreme = abs(volts), abs(past[EXTREME])
    if volts * past[EXTREME] < 0.0 or past[DIRECTION] == 0.0:
        past[EXTREME] = volts
        past[DIRECTION] = 1.0 if size > 0.0 else past[DIRECTION]
    elif past[DIRECTION] > 0.0:
        if size < extreme - slack:
            past[DIRECTION] = -1.0
        if size > extreme or past[DIRECTION] < 0.0:
            past[EXTREME] = volts
    else:
        if size > extreme + slack:
            past[DIRECTION] = 1.0
        if size < extreme or past[DIRECTION] > 0.0:
            past[EXTREME] = volts


@allocation_free
def filtered_load(load, torque, h):
    """The load of a gear after h s in which it delivered `torque`, N·m; load : N·m before."""
    return load + (torque - load) * (1.0 - math.exp(-h / LOAD_S))


@allocation_free
def warmed(heat, current, h, tau):
    """A heat, A², after h s at a mean current, A, with the time constant tau, s.

    heat' = (current² - heat) / tau, solved exactly for an even current: one mass that takes up the loss of a resistance
    and gives it off to its surroundings (IEC 60255-149, "Functional requirements for thermal electrical relays", 2013).
    """
    return heat + (current * current - heat) * (1.0 - math.exp(-h / tau))


@loop
def heats(t, currents, tau):
    """Heats (n,) A² of currents (n,) A at times t (n,) s, nothing at first; tau : s."""
    found = np.zeros(len(t))
    for k in range(1, len(t)):
        found[k] = warmed(found[k - 1], 0.5 * (currents[k - 1] + currents[k]), t[k] - t[k - 1], tau)
    return found


@allocation_free
def remember(rows, torque, current, h, past):
    """Take what a side's forms remember of a step to its end.

    rows : (MOST_FORMS, WIDTH); torque : N·m that the gear delivered and current : A in the mean of the step; h : s;
    past : (PAST,), changed.
    """
    # Each replay with a form passes here at each step: an exponential is taken only for a form that asks for it.
    over_load = False
    for n in range(MOST_FORMS):
        over_load |= rows[n][TERM] != 0.0 and rows[n][OVER] == _LOAD
        # Only a form over a heat has one.
        tau = rows[n][TAU]
        if tau > 0.0:
            past[HEATS + n] = warmed(past[HEATS + n], current, h, tau)
    if over_load:
        past[GEAR_LOAD] = filtered_load(past[GEAR_LOAD], torque, h)


@allocation_free
def reads(rows, term, over, x):
    """What a side's forms add to a sensor's reading of x, in x's unit; term, over : their codes."""
    total = 0.0
    for n in range(MOST_FORMS):
        if rows[n][TERM] == term and rows[n][OVER] == over:
            total += curve(rows[n], x)[0]
    return total


@allocation_free
def turns_read(rows, rate, elapsed):
    """What a robot's forms add to its gyro's reading of `rate` rad/s, `elapsed` s after the run began, rad/s."""
    return reads(rows, _GYRO, _RATE, rate) + reads(rows, _GYRO, _TIME, elapsed)


@allocation_free
def any_of(rows):
    """Whether there is a form among rows (2, MOST_FORMS, WIDTH)."""
    for k in range(rows.shape[0]):
        for n in range(MOST_FORMS):
            if rows[k, n, TERM] != 0.0:
                return True
    return False


@allocation_free
def any_read(rows):
    """Whether one of the forms (2, MOST_FORMS, WIDTH) is of what a sensor reads."""
    for k in range(rows.shape[0]):
        for n in range(MOST_FORMS):
            if _FIRST_READ <= rows[k, n, TERM] <= _GYRO:
                return True
    return False


@allocation_free
def any_over_current(rows):
    """Whether one of the forms (2, MOST_FORMS, WIDTH) runs over the mean current of a step."""
    for k in range(rows.shape[0]):
        for n in range(MOST_FORMS):
            if rows[k, n, OVER] == _I and rows[k, n, TERM] != 0.0 and rows[k, n, TERM] != _VOLTAGE:
                return True
    return False


@allocation_free
def any_scrub(rows):
    """Whether one of the forms (2, MOST_FORMS, WIDTH) holds the robot against its yaw rate."""
    for n in range(MOST_FORMS):
        if rows[0, n, TERM] == _YAW and rows[0, n, OVER] == _RATE:
            return True
    return False


@allocation_free
def any_remembered(rows):
    """Whether one of the forms (2, MOST_FORMS, WIDTH) runs over what is remembered of steps before."""
    for k in range(rows.shape[0]):
        for n in range(MOST_FORMS):
            if rows[k, n, TERM] != 0.0 and (rows[k, n, OVER] == _LOAD or rows[k, n, OVER] == _HEAT):
                return True
    return False


@allocation_free
def holds(rows):
    """Whether a side's forms (MOST_FORMS, WIDTH) hold dry friction."""
    for n in range(MOST_FORMS):
        over = rows[n][OVER]
        if rows[n][TERM] == _TORQUE and (over == _W or over == _LOAD or over == _HEAT):
            return True
    return False
