"""A differential-drive robot in plain Python: motors, friction, body and sensors, without any other package.

    robot = Robot()
    robot.step(6.0, 6.0, 0.01)          # left and right for so many seconds: volts, or rad/s where there is a servo
    print(robot.sensors())

Model: wheels that roll without slip carry a body on a plane; each motor is a resistance with a back EMF (its inductance
left out). Dry friction holds or slips: impulses within their bounds, found by projected Gauss-Seidel (J. J. Moreau,
1988). A servo is a saturated PI controller on the reported wheel speed. Terms of unmodelled form are curves over a
quantity. `PARAMETERS` holds the robot; units are SI, pairs are [left, right].
"""

import math
from collections import deque

# laws: begin
from rtds_host.export.settled import settled
from rtds_host.plant.driver import bus_current, clipped, duty, servo, winding_voltage
from rtds_host.plant.elementary import exponential
from rtds_host.plant.forms import (
    ABOUT,
    ACTS,
    BACKWARD,
    CONSTANT,
    DIRECTION,
    DRIVE,
    FLUID,
    FORWARD,
    GEAR_LOAD,
    MEAN_I,
    OVER_CODE,
    PAST,
    PUSH,
    SCRUB,
    TERM_CODE,
    TURN,
    VOLTS,
    act,
    follow,
    reads,
    remember,
    turns_read,
)
from rtds_host.plant.friction import by_load, rolling, stribeck, viscous
from rtds_host.plant.ground import along_slope, offset_forces, slope_torque
from rtds_host.plant.motor import warm, warmer
from rtds_host.plant.sensors import low_pass, scaled
from rtds_host.plant.torque import functions
from rtds_host.plant.torques import TORQUES

# Readings that a curve may add to: its term, and what it runs over.
I_READ = TERM_CODE["current_sensor"], OVER_CODE["i"]
W_READ = TERM_CODE["speed_sensor"], OVER_CODE["w"]
shaped_torque = functions(TORQUES, "p, k", lambda entry: f"p['{entry.export}'][k]", plain=True)[0]

# laws: end
PARAMETERS: dict = {}
GRAVITY_M_S2 = 9.80665
STEP_S = 2.5e-4
SWEEPS = 30


class Robot:
    """The robot of `PARAMETERS`, at rest at the start.

    `pose` is (x, y, yaw, left angle, right angle); the plane climbs by `slope_rad` towards the heading
    `uphill_yaw_rad`.
    """

    def __init__(
        self, parameters=None, pose=(0.0, 0.0, 0.0, 0.0, 0.0), payload_kg=0.0, slope_rad=0.0, uphill_yaw_rad=0.0
    ):
        p = self.p = PARAMETERS if parameters is None else parameters
        self.t = 0.0
        self.x, self.y, self.yaw = pose[:3]
        self.th = list(pose[3:5])
        self.start = tuple(pose[3:5])
        self.w = [0.0, 0.0]
        self.i = [0.0, 0.0]
        self.rise = [0.0, 0.0]
        self.load = [0.0, 0.0]
        self.filtered = [0.0, 0.0]
        self.bus = p["supply_v"]
        # Curves of each side, and what they come to now.
        self.forms = p.get("forms") or []
        self.acts = [[0.0] * ACTS, [0.0] * ACTS]
        self.made = [0.0, 0.0]
        self.past = [[0.0] * PAST, [0.0] * PAST]
        self.mass = p["mass_kg"] + payload_kg
        self.slope = slope_rad + p["slope_extra_rad"]
        self.uphill = uphill_yaw_rad
        r, b = p["radius_m"], p["track_m"]
        self.forward = (0.5 * r[0], 0.5 * r[1])
        self.turn = (-r[0] / b, r[1] / b)
        m, my, iz = self.mass, -self.mass * p["com_y_m"], p["yaw_inertia_kg_m2"]
        f, g = self.forward, self.turn
        self.inertia = [
            [
                m * f[j] * f[k]
                + my * (f[j] * g[k] + g[j] * f[k])
                + iz * g[j] * g[k]
                + (p["rotor_kg_m2"][k] + p["wheel_inertia_kg_m2"] if j == k else 0.0)
                for k in (0, 1)
            ]
            for j in (0, 1)
        ]
        self.asked = deque([(0.0, (0.0, 0.0))])
        self.integral = [0.0, 0.0]
        self.loop_at = 0.0
        self.loop_volts = (0.0, 0.0)
        self.seen = deque([(0.0, self._report())])

    def step(self, left, right, dt):
        """Go on by `dt` seconds with these voltages commanded; wheel speeds, rad/s, where there is a servo."""
        self.asked.append((self.t, (left, right)))
        count = max(1, math.ceil(dt / STEP_S - 1e-9))
        for _ in range(count):
            self.advance(dt / count)
        latest = self.p["measurement_delay_s"] + max(self.p["speed_delay_s"])
        while len(self.seen) > 2 and self.seen[1][0] <= self.t - latest:
            self.seen.popleft()

    def sensors(self):
        """What is reported now, without noise: a dictionary by channel."""
        late = self.p["measurement_delay_s"]
        found = self._seen(late)
        for side, more in zip("lr", self.p["speed_delay_s"]):
            if more:
                found["w_" + side] = self._seen(late + more)["w_" + side]
        return {**found, "x": self.x, "y": self.y, "yaw": self.yaw}

    def _seen(self, late):
        """What was there so many seconds before."""
        at = self.t - late
        (t0, a), (t1, b) = self.seen[-1], self.seen[-1]
        for before, after in zip(self.seen, list(self.seen)[1:]):
            if after[0] >= at:
                (t0, a), (t1, b) = before, after
                break
        share = 1.0 if t1 <= t0 else min(max((at - t0) / (t1 - t0), 0.0), 1.0)
        return {name: (1.0 - share) * a[name] + share * b[name] for name in a}

    def _reads(self, k, sensor, value):
        """What curves add to the reading of a sensor of side k."""
        return reads(self.forms[k], sensor[0], sensor[1], value) if self.forms else 0.0

    def _report(self):
        p = self.p
        rate = scaled(self._rate(), p["gyro_gain"], p["gyro_bias_rad_s"])
        found = {"v_bus": self.bus, "gyro_z": rate + (turns_read(self.forms[0], rate, self.t) if self.forms else 0.0)}
        for k, side in enumerate("lr"):
            current = scaled(self.i[k], p["current_gain"][k], p["current_bias_a"][k])
            speed = self.filtered[k] if p["speed_filter_s"][k] > 0.0 else self.w[k]
            found["i_" + side] = current + self._reads(k, I_READ, current)
            found["w_" + side] = speed * p["speed_gain"][k] + self._reads(k, W_READ, speed * p["speed_gain"][k])
            found["th_" + side] = self.start[k] + (self.th[k] - self.start[k]) * p["speed_gain"][k]
        return found

    def _rate(self):
        return self.turn[0] * self.w[0] + self.turn[1] * self.w[1]

    def _command(self):
        """The voltages that act now: late ones, or those by which the servo follows late speeds."""
        at = self.t - self.p["command_delay_s"] + 1e-9
        while len(self.asked) > 1 and self.asked[1][0] <= at:
            self.asked.popleft()
        loop = self.p["servo"]
        if loop is None:
            return self.asked[0][1]
        if self.loop_at <= self.t + 1e-9:
            gains, volts = (loop["kp_v_s_per_rad"], loop["ki_v_per_rad"], loop["period_s"], loop["limit_v"], 0.0), []
            for k in (0, 1):
                told = self.w[k] * self.p["speed_gain"][k]
                miss = self.asked[0][1][k] * self.p["command_gain"][k] - told - self._reads(k, W_READ, told)
                wanted, self.integral[k] = servo(miss, self.integral[k], *gains)
                volts.append(wanted)
            self.loop_volts = tuple(volts)
            while self.loop_at <= self.t + 1e-9:
                self.loop_at += loop["period_s"]
        return self.loop_volts

    def _volts(self, asked, k):
        """What the driver makes of a command, before the bus and its limit."""
        p, top = self.p, self.p["supply_v"]
        return duty(clipped(asked, top), top, p["pwm_curve"][k], p["deadzone_v"][k], p["voltage_gain"][k])

    def _friction(self, k):
        """Bounds of dry friction against turning forwards and backwards, N·m."""
        p = self.p
        level = p["dry_nm"][k] + rolling(p["rolling"], self.mass, p["radius_m"][k])
        if p["stribeck_nm"][k]:
            level += stribeck(self.w[k] / p["stribeck_rad_s"][k], p["stribeck_nm"][k], exponential)
        level += by_load(p["load_share"][k], self.load[k], 0.0)
        ahead, back = self.acts[k][FORWARD], self.acts[k][BACKWARD]
        return level + p["asymmetry_nm"][k] + ahead, level - p["asymmetry_nm"][k] + back

    def _act(self, asked, h):
        """Let curves act over a step of h seconds; asked : V, clipped."""
        about = [0.0] * ABOUT
        speed, rate = self.forward[0] * self.w[0] + self.forward[1] * self.w[1], self._rate()
        for k in (0, 1):
            angle = self.th[k] + 0.5 * h * self.w[k]
            ohm = warm(self.p["resistance_ohm"][k], self.rise[k])
            current, self.made[k] = settled(self.forms[k], ohm, self.i[k], self.made[k])
            past = self.past[k]
            follow(self.forms[k], asked[k], past)
            about[:6] = asked[k], past[DIRECTION] * abs(asked[k]), current, self.w[k], past[GEAR_LOAD], rate
            about[6:9] = angle, self.p["gear_ratio"] * angle, speed * rate
            about[9:14], about[MEAN_I] = (speed, self.t, self.x, self.y, self.yaw), current
            act(self.forms[k], about, past, self.acts[k])

    def advance(self, h):
        p, w = self.p, self.w
        asked = self._command()
        top = p["supply_v"]
        drawn = sum(bus_current(self.i[k], clipped(asked[k], top), top) for k in (0, 1))
        if self.forms:
            self._act([clipped(volts, top) for volts in asked], h)
        gear, ke = (
            [p[name][k] * (1.0 + self.acts[k][CONSTANT]) for k in (0, 1)]
            for name in ("gear_nm_per_a", "back_emf_v_s_per_rad")
        )
        self.bus = top - p["decline_v_per_s"] * self.t - p["source_resistance_ohm"] * drawn
        a = [[self.inertia[j][k] for k in (0, 1)] for j in (0, 1)]
        b = [sum(a[j][k] * w[k] for k in (0, 1)) for j in (0, 1)]
        volts, ohm, fluid, extra = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        for k in (0, 1):
            level = (self._volts(asked[k], k) + self.acts[k][VOLTS]) * self.bus / top
            volts[k] = winding_voltage(
                level, ke[k] * w[k], p["limit_v"][k], p["drop_v"][k], p["drop_knee_a"][k], p["resistance_ohm"][k]
            )
            ohm[k] = warm(p["resistance_ohm"][k], self.rise[k])
            fluid[k] = viscous(p["viscous_nm_s_per_rad"][k], p["asymmetry_nm_s_per_rad"][k], w[k])
            fluid[k] += self.acts[k][FLUID]
            # Half implicit: the middle of the step, of second order.
            damping = gear[k] * ke[k] / ohm[k] + fluid[k]
            extra[k] = shaped_torque(self.th[k] + 0.5 * h * w[k], w[k], p, k, math.sin) + self.acts[k][DRIVE]
            a[k][k] += 0.5 * h * damping
            b[k] += h * (gear[k] * volts[k] / ohm[k] + extra[k] - 0.5 * damping * w[k])
        speed, rate = self.forward[0] * w[0] + self.forward[1] * w[1], self._rate()
        heading = self.yaw + 0.5 * h * rate - self.uphill
        pull = along_slope(self.mass, self.slope, math.sin)
        push, twist = offset_forces(self.mass, p["com_x_m"], speed, rate)
        push += self.acts[0][PUSH] - pull * math.cos(heading)
        twist += self.acts[0][TURN] + slope_torque(
            pull, p["com_x_m"], p["com_y_m"], math.cos(heading), math.sin(heading)
        )
        for k in (0, 1):
            b[k] += h * (self.forward[k] * push + self.turn[k] * twist)
        new, impulses = self._slip(a, b, h)
        for k in (0, 1):
            mean = 0.5 * (w[k] + new[k])
            current = (volts[k] - ke[k] * mean) / ohm[k]
            self.i[k] = (volts[k] - ke[k] * new[k]) / ohm[k]
            if p["heat_rise_per_w"][k]:
                heat, slow = p["heat_rise_per_w"][k], p["heat_tau_s"][k]
                self.rise[k] = warmer(self.rise[k], h, heat, slow, current, ohm[k])
            torque = gear[k] * current - fluid[k] * mean - p["rotor_kg_m2"][k] * (new[k] - w[k]) / h
            self.load[k] = max(abs(torque), abs(torque + impulses[k] / h))
            if self.forms:
                delivered = torque + extra[k] + impulses[k] / h
                remember(self.forms[k], delivered, current, h, self.past[k])
            tau = p["speed_filter_s"][k]
            if tau > 0.0:
                self.filtered[k] = low_pass(self.filtered[k], new[k], w[k], h, tau, math.exp(-h / tau))
            self.th[k] += h * mean
        after = self.turn[0] * new[0] + self.turn[1] * new[1]
        middle = self.yaw + 0.25 * h * (rate + after)
        way = 0.5 * h * (speed + self.forward[0] * new[0] + self.forward[1] * new[1])
        self.x += way * math.cos(middle)
        self.y += way * math.sin(middle)
        self.yaw += 0.5 * h * (rate + after)
        self.w = new
        self.t += h
        self.seen.append((self.t, self._report()))

    def _slip(self, a, b, h):
        """Speeds at the end of a step, and the impulses of dry friction at both wheels: a new = b + impulses."""
        determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0]
        inverse = ((a[1][1] / determinant, -a[0][1] / determinant), (-a[1][0] / determinant, a[0][0] / determinant))
        ways = [((1.0, 0.0), *self._friction(0)), ((0.0, 1.0), *self._friction(1))]
        scrub = self.p["scrub_nm"] + self.acts[0][SCRUB]
        if scrub:
            ways.append((self.turn, scrub, scrub))
        ways = [(way, -h * f, h * g) for way, f, g in ways if f or g]
        new = [inverse[j][0] * b[0] + inverse[j][1] * b[1] for j in (0, 1)]
        impulses = [0.0] * len(ways)
        moves = [tuple(inverse[j][0] * way[0] + inverse[j][1] * way[1] for j in (0, 1)) for way, _, _ in ways]
        for _ in range(SWEEPS if ways else 0):
            changed = 0.0
            for n, (way, low, high) in enumerate(ways):
                give = way[0] * moves[n][0] + way[1] * moves[n][1]
                slides = way[0] * new[0] + way[1] * new[1]
                wanted = min(max(impulses[n] - slides / give, min(low, high)), max(low, high))
                change = wanted - impulses[n]
                impulses[n] = wanted
                new = [new[j] + moves[n][j] * change for j in (0, 1)]
                changed = max(changed, abs(change) * give)
            if changed < 1e-12:
                break
        at_wheels = [0.0, 0.0]
        for n, (way, _, _) in enumerate(ways):
            if way in ((1.0, 0.0), (0.0, 1.0)):
                at_wheels[0 if way[0] else 1] = impulses[n]
        return new, at_wheels
