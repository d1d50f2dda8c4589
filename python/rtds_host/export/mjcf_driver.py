"""What acts before MuJoCo's `<dcmotor>` and behind its sensors, for a robot of `rtds export --actuator dcmotor`.

    model = mujoco.MjModel.from_xml_path("robot.xml")
    data = mujoco.MjData(model)
    driver = Driver(model)
    driver.step(data, left, right)      # in place of mujoco.mj_step; volts, wheel speeds (rad/s) where there is a servo
    driver.readings(data)               # channels of a log, without noise

The numbers are those of the file (custom/numeric). Before each step: the servo's loop, the driver's curve, dead zone
and drop, the bus, gear loss by the torque that the gear transmits (bound of the joint's dry friction, by the torque of
the step before), friction by direction and speed. Behind: gains, biases and filters of sensors, current in ampere.
Friction that falls with speed (Stribeck's) is the joint's dry friction here, with a bound by the speed, in place of the
file's LuGre friction: a wheel then stands still until it breaks away, where a bristle yields before.
Where several environments share a model, each needs a model of its own if there is gear loss or such friction.
"""

import math
from collections import deque

import mujoco
import numpy as np

# laws: begin
from rtds_host.export.mjcf_forms import Forms
from rtds_host.plant.driver import after_bridge_drop, clipped, duty, servo
from rtds_host.plant.friction import by_load, rolling, stribeck

# laws: end
GRAVITY_M_S2 = 9.80665
SIDES = ("left", "right")
# N·m; LuGre friction that is as good as none. Its stiffness stays: the number of activations depends on it.
NO_FRICTION_NM = 1e-12
# Numbers of a file that leaves them out: nothing acts.
NOTHING = {"speed_gain": 1.0, "current_gain": 1.0, "gyro_gain": 1.0, "voltage_gain": 1.0, "command_gain": 1.0}


class Driver:
    """The driver, bus and sensors of one simulation. Holds state: one for each `MjData`."""

    def __init__(self, model, payload_kg=0.0, measured_bus=False):
        """`payload_kg`: beyond the file's mass, for its rolling resistance; the body's mass is the caller's to set.
        `measured_bus`: `bus` is set from outside."""
        self.model, self.measured_bus = model, measured_bus
        there = {model.numeric(k).name: model.numeric(k).data for k in range(model.nnumeric)}
        self.numbers = {name: [float(data[0]), float(data[-1])] for name, data in there.items()}
        self.supply = self.number("supply_v")[0]
        self.motors = [model.actuator("motor_" + side).id for side in SIDES]
        self.joints = [model.joint("wheel_" + side) for side in SIDES]
        self.dofs = [int(joint.dofadr[0]) for joint in self.joints]
        # The current is the last of an element's activations.
        self.current_at = [int(model.actuator_actadr[k] + model.actuator_actnum[k] - 1) for k in self.motors]
        self.sensors = {name: int(model.sensor(name).adr[0]) for name in ("w_l", "w_r", "th_l", "th_r", "gyro")}
        radii = [float(model.geom("wheel_" + side).size[0]) for side in SIDES]
        coefficient = self.number("rolling_coefficient")[0]
        # Where the bound changes, the file's is a number: the model's may be that of a run before.
        own = self.numbers.get("dry_nm", [float(model.dof_frictionloss[dof]) for dof in self.dofs])
        self.dry = [dry + rolling(coefficient, payload_kg, radius) for dry, radius in zip(own, radii)]
        self.share = self.number("load_share")
        self.extra, self.extra_until = self.number("stribeck_nm"), self.number("stribeck_rad_s")
        for k in (0, 1):
            if self.extra[k]:
                model.actuator_biasprm[self.motors[k]][3:5] = NO_FRICTION_NM
        self.bus = self.supply
        self.integral, self.volts, self.loop_at = [0.0, 0.0], [0.0, 0.0], 0.0
        self.asked = deque([(0.0, (0.0, 0.0))])
        self.past: deque = deque()
        self.filtered: list = []
        self.seen: list = []
        for dof, dry in zip(self.dofs, self.dry):
            model.dof_frictionloss[dof] = dry
        self.forms = Forms(model)

    def number(self, name):
        """A pair of the file's numbers, [left, right]."""
        return self.numbers.get(name, [NOTHING.get(name, 0.0)] * 2)

    def currents(self, data):
        """Currents of both motors now, A."""
        scale = self.number("current_per_activation")
        return [scale[k] * float(data.act[self.current_at[k]]) for k in (0, 1)]

    def step(self, data, left, right):
        """A step of the simulation with these commands."""
        self.before(data, left, right)
        mujoco.mj_step(self.model, data)
        self.after(data)

    def before(self, data, left, right):
        """What a command is before `ctrl`, and what friction is by load and direction."""
        speeds = [float(data.qvel[dof]) for dof in self.dofs]
        asked = self._servo(data.time, left, right, speeds)
        curve, dead = self.number("pwm_curve"), self.number("deadzone_v")
        drop, knee, resistance = (self.number(name) for name in ("drop_v", "drop_knee_a", "resistance_ohm"))
        emf, gain = self.number("back_emf_v_s_per_rad"), self.number("voltage_gain")
        asked = [clipped(volts, self.supply) for volts in asked]
        currents = self.currents(data)
        if not self.measured_bus:
            drawn = (currents[0] * asked[0] + currents[1] * asked[1]) / self.supply
            self.bus = (
                self.supply
                - self.number("decline_v_per_s")[0] * data.time
                - self.number("source_resistance_ohm")[0] * drawn
            )
        dry = [self._bound(data, k, speeds[k]) for k in (0, 1)]
        more = self.forms.before(data, asked, currents, dry)
        for k in (0, 1):
            level = duty(asked[k], self.supply, curve[k], dead[k], 1.0)
            volts = (level + (more[k] / gain[k] if gain[k] else 0.0)) * self.bus / self.supply
            if drop[k] and gain[k]:
                there = after_bridge_drop(gain[k] * volts, emf[k] * speeds[k], drop[k], knee[k], resistance[k])
                volts = there / gain[k]
            data.ctrl[self.motors[k]] = volts
            by_speed = self.number("asymmetry_nm_s_per_rad")[k]
            if by_speed:
                other = float(data.qfrc_applied[self.dofs[k]]) if self.forms.any else 0.0
                data.qfrc_applied[self.dofs[k]] = other - by_speed * abs(speeds[k])
            if (self.share[k] or self.extra[k]) and not self.forms.any:
                self.model.dof_frictionloss[self.dofs[k]] = dry[k]

    def _bound(self, data, k, speed):
        """Dry friction of a wheel, N·m, by its speed and by the torque that the gear transmits."""
        bound = self.dry[k]
        if self.extra[k]:
            bound += stribeck(speed / self.extra_until[k], self.extra[k], lambda y: math.exp(-y))
        if self.share[k]:
            bound += by_load(self.share[k], *self._load(data, k))
        return bound

    def _load(self, data, k):
        """Torques at a gear before and behind its dry friction, N·m at the wheel, in the last step."""
        model, dof, motor = self.model, self.dofs[k], self.motors[k]
        # Torque of the winding: gear K i'.
        before = (
            model.actuator_gear[motor][0] * model.actuator_gainprm[motor][1] * float(data.act[self.current_at[k]])
            - model.dof_damping[dof].flat[0] * data.qvel[dof]
            - model.dof_armature[dof] * data.qacc[dof]
        )
        friction = 0.0
        for row in range(data.ne, data.ne + data.nf):
            if data.efc_type[row] == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF and data.efc_id[row] == dof:
                friction = float(data.efc_force[row])
        return float(before), float(before) + friction

    def _servo(self, now, left, right, speeds):
        """Volts of a loop that follows wheel speeds, or the command."""
        period = self.number("servo_period_s")[0]
        if not period:
            return left, right
        self.asked.append((now, (left, right)))
        at = now - self.number("command_delay_s")[0] + 1e-9
        while len(self.asked) > 1 and self.asked[1][0] <= at:
            self.asked.popleft()
        if self.loop_at <= now + 1e-9:
            kp, ki, limit = (
                self.number(name)[0] for name in ("servo_kp_v_s_per_rad", "servo_ki_v_per_rad", "servo_limit_v")
            )
            scale, gain = self.number("speed_gain"), self.number("command_gain")
            for k in (0, 1):
                told = self.forms.told(k, speeds[k] * scale[k])
                miss = self.asked[0][1][k] * gain[k] - told
                self.volts[k], self.integral[k] = servo(miss, self.integral[k], kp, ki, period, limit, 0.0)
            while self.loop_at <= now + 1e-9:
                self.loop_at += period
        return tuple(self.volts)

    def after(self, data):
        """Take filters and the delayed current to the end of a step."""
        now = [float(data.sensordata[self.sensors["w_" + side]]) for side in "lr"]
        if not self.seen:
            self.seen, self.filtered = now, list(now)
        self.filtered = [self._behind(k, now[k]) for k in (0, 1)]
        self.seen = now
        delay = self.number("current_delay_s")[0]
        if delay > 0.0:
            self.past.append((data.time, self.currents(data)))
            while len(self.past) > 2 and self.past[1][0] <= data.time - delay:
                self.past.popleft()

    def _behind(self, k, now):
        """A filter's speed once its sensor shows `now`, a step after what it has seen."""
        tau = self.number("speed_filter_s")[k]
        if tau <= 0.0:
            return now
        mean = 0.5 * (self.seen[k] + now)
        return mean + (self.filtered[k] - mean) * math.exp(-self.model.opt.timestep / tau)

    def _delayed_currents(self, data):
        """Currents as they are reported, with their delay."""
        delay = self.number("current_delay_s")[0]
        if delay <= 0.0 or not self.past:
            return self.currents(data) if delay <= 0.0 else [0.0, 0.0]
        times = [time for time, _ in self.past]
        at = data.time - delay
        if at < times[0]:
            return [0.0, 0.0]
        return [float(np.interp(at, times, [pair[k] for _, pair in self.past])) for k in (0, 1)]

    def readings(self, data):
        """What is reported now, without noise, by channel; the sensors of `data` are those of its last evaluation."""
        gain, bias = self.number("current_gain"), self.number("current_bias_a")
        scale, tau = self.number("speed_gain"), self.number("speed_filter_s")
        currents = self._delayed_currents(data)
        found = {"v_bus": self.bus}
        for k, side in enumerate("lr"):
            speed = float(data.sensordata[self.sensors["w_" + side]])
            if tau[k] > 0.0 and self.filtered:
                # Sensors evaluated since the step are a step ahead of the filter.
                speed = self.filtered[k] if speed == self.seen[k] else self._behind(k, speed)
            found["i_" + side] = currents[k] * gain[k] + bias[k]
            found["w_" + side] = speed * scale[k]
            found["th_" + side] = float(data.sensordata[self.sensors["th_" + side]]) * scale[k]
        rate = float(data.sensordata[self.sensors["gyro"] + 2])
        found["gyro_z"] = rate * self.number("gyro_gain")[0] + self.number("gyro_bias_rad_s")[0]
        self.forms.readings(found, float(data.time))
        return found
