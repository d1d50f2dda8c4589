"""A TurtleBot3 Burger simulated from its data sheets alone; nothing of the program is used here.

Against the program's replay it differs where real robots do: Heun's method in steps of 0.4 ms, an armature without
inductance, a servo that runs every 2 ms on a filtered speed in counts, puts out whole counts of duty, and stops its
integral by back-calculation; a bus that is a battery of 10.8 to 12.6 V with a resistance of its own; a controller board
that is asked for a new speed some milliseconds after the message came.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

# XL430-W250-T and the Burger: winding, constant and inertia as robots/burger.toml takes them from the data sheet.
OHM, KM, ROTOR, VISCOUS, GEAR = 8.6, 6.538e-3, 1.0e-7, 4.372e-7, 258.5
MASS, YAW_INERTIA, WHEEL_INERTIA, RADIUS, TRACK = 1.0, 2.5e-3, 2.07e-5, 0.033, 0.160
NOMINAL_V = 12.0
RPM_COUNT = 0.229 * 2.0 * math.pi / 60.0  # a count of present and goal velocity, rad/s
DUTY_COUNTS = 885  # a full duty
STEP_S, SERVO_S = 0.0004, 0.002
STILL = 1e-9


@dataclass
class Fault:
    """What the robot has that its file does not, a value a side (left, right); `delay_s` of the commands."""

    coulomb_nm: tuple[float, float] = (0.0, 0.0)
    deadzone_v: tuple[float, float] = (0.0, 0.0)
    gain: tuple[float, float] = (1.0, 1.0)
    radius: tuple[float, float] = (1.0, 1.0)
    delay_s: float = 0.0


@dataclass
class Servo:
    """Gains of the inner loop, V s/rad and V/rad, the smoothing of its speed, and how its integral is held."""

    kp: float = 0.4417
    ki: float = 8.628
    smooth: float = 0.35
    release: float = 0.5


@dataclass
class Burger:
    """State and step of the robot; speeds of the wheels rad/s, angles rad, pose m and rad."""

    fault: Fault
    servo: Servo
    battery_v: float = 12.0
    battery_ohm: float = 0.08
    drop_v_per_s: float = 0.0
    time_s: float = 0.0
    speed: list[float] = field(default_factory=lambda: [0.0, 0.0])
    angle: list[float] = field(default_factory=lambda: [12.6, 41.3])
    pose: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    bus_v: float = 12.0
    goal: list[float] = field(default_factory=lambda: [0.0, 0.0])

    def __post_init__(self):
        self._duty = [0.0, 0.0]
        self._integral = [0.0, 0.0]
        self._seen = [0.0, 0.0]
        self._next_servo = 0.0
        self.bus_v = self.battery_v
        own = GEAR**2 * ROTOR + WHEEL_INERTIA
        radii = [RADIUS * r for r in self.fault.radius]
        # Kinetic energy of body and wheels in the two wheel speeds.
        self._m = [
            [
                own + MASS * radii[0] ** 2 / 4 + YAW_INERTIA * radii[0] ** 2 / TRACK**2,
                (MASS / 4 - YAW_INERTIA / TRACK**2) * radii[0] * radii[1],
            ],
            [0.0, 0.0],
        ]
        self._m[1] = [self._m[0][1], own + MASS * radii[1] ** 2 / 4 + YAW_INERTIA * radii[1] ** 2 / TRACK**2]
        self._radii = radii

    def _control(self) -> None:
        """One turn of both servos: counts in, counts out; the integral is drawn back by what the duty was cut."""
        for k in (0, 1):
            count = round(self.speed[k] / RPM_COUNT)
            self._seen[k] += (1.0 - self.servo.smooth) * (count * RPM_COUNT - self._seen[k])
            miss = self.goal[k] - self._seen[k]
            want = self.servo.kp * miss + self._integral[k]
            cut = max(-NOMINAL_V, min(NOMINAL_V, want))
            self._integral[k] += self.servo.ki * SERVO_S * miss + self.servo.release * (cut - want)
            self._duty[k] = round(cut / NOMINAL_V * DUTY_COUNTS) / DUTY_COUNTS

    def _accelerations(self, speed: list[float], volts: list[float]) -> tuple[float, float]:
        drive = [GEAR * KM * (volts[k] - KM * GEAR * speed[k]) / OHM - GEAR**2 * VISCOUS * speed[k] for k in (0, 1)]
        (a, b), (_, d) = self._m
        det = a * d - b * b
        rub = [math.copysign(self.fault.coulomb_nm[k], speed[k]) if abs(speed[k]) > STILL else 0.0 for k in (0, 1)]
        for _ in range(6):
            for k in (0, 1):
                if abs(speed[k]) <= STILL and self.fault.coulomb_nm[k] > 0.0:
                    # At rest dry friction is whatever holds the wheel, the other one's pull through the body included.
                    other = drive[1 - k] - rub[1 - k]
                    hold = drive[k] - b / (a if k else d) * other
                    rub[k] = max(-self.fault.coulomb_nm[k], min(self.fault.coulomb_nm[k], hold))
        left, right = drive[0] - rub[0], drive[1] - rub[1]
        return (d * left - b * right) / det, (a * right - b * left) / det

    def step(self) -> None:
        """Advance by `STEP_S`."""
        if self.time_s >= self._next_servo - 1e-9:
            self._control()
            self._next_servo += SERVO_S
        volts, current = [0.0, 0.0], 0.0
        for k in (0, 1):
            v = self._duty[k] * self.bus_v
            v = math.copysign(max(abs(v) - self.fault.deadzone_v[k], 0.0), v) * self.fault.gain[k]
            volts[k] = v
            current += self._duty[k] * (v - KM * GEAR * self.speed[k]) / OHM
        empty = self.battery_v - self.drop_v_per_s * self.time_s
        self.bus_v = empty - self.battery_ohm * current
        first = self._accelerations(self.speed, volts)
        guess = [self._rubbed(k, self.speed[k], STEP_S * first[k]) for k in (0, 1)]
        second = self._accelerations(guess, volts)
        new = [self._rubbed(k, self.speed[k], 0.5 * STEP_S * (first[k] + second[k])) for k in (0, 1)]
        mean = [0.5 * (self.speed[k] + new[k]) for k in (0, 1)]
        left, right = self._radii[0] * mean[0], self._radii[1] * mean[1]
        turn, way = (right - left) / TRACK, 0.5 * (left + right)
        heading = self.pose[2] + 0.5 * STEP_S * turn
        self.pose[0] += STEP_S * way * math.cos(heading)
        self.pose[1] += STEP_S * way * math.sin(heading)
        self.pose[2] += STEP_S * turn
        for k in (0, 1):
            self.angle[k] += STEP_S * mean[k]
        self.speed = new
        self.time_s += STEP_S

    def _rubbed(self, k: int, speed: float, change: float) -> float:
        """A speed after a change; dry friction stops a wheel before it turns it round."""
        after = speed + change
        return 0.0 if self.fault.coulomb_nm[k] > 0.0 and speed * after < 0.0 else after

    @property
    def yaw_rate(self) -> float:
        """Yaw rate of the body, rad/s."""
        return (self._radii[1] * self.speed[1] - self._radii[0] * self.speed[0]) / TRACK
