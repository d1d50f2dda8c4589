"""Terms that MuJoCo has no element for, as curves, for a robot of `rtds export --to mjcf`.

    model = mujoco.MjModel.from_xml_path("robot.xml")
    data = mujoco.MjData(model)
    forms = Forms(model)
    more = forms.before(data, volts, currents)  # before each step: sets torques, gives V to add behind the driver
    forms.readings(found, data.time)            # adds to what sensors report, by channel

The curves are those of the file: custom/numeric form_left_1 and so on, each a term, what it runs over, the ends of its
grid, the time constant of a heat, and its values. Torques are `qfrc_applied`, dry friction and damping are those of the
wheels' joints, and dry friction is that of the tendon `scrub`, too.
"""

import math

# laws: begin
from rtds_host.export.settled import settled
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
    HALF,
    MEAN_I,
    MOST_FORMS,
    OVER_CODE,
    PAST,
    PUSH,
    SCRUB,
    TERM_CODE,
    TURN,
    VALUES,
    VOLTS,
    act,
    back_emf,
    follow,
    reads,
    remember,
    turns_read,
)

I_READ = TERM_CODE["current_sensor"], OVER_CODE["i"]
W_READ = TERM_CODE["speed_sensor"], OVER_CODE["w"]
OVER_LOAD = OVER_CODE["load"]
# laws: end


class Forms:
    """The curves of one simulation. It changes dry friction and damping of the model: each simulation needs its own."""

    FRICTION_DOF = 1  # mjCNSTR_FRICTION_DOF

    def __init__(self, model):
        numbers = {model.numeric(k).name: [float(v) for v in model.numeric(k).data] for k in range(model.nnumeric)}
        self.model, self.any = model, any(name.startswith("form_") for name in numbers)
        nothing = [0.0] * (VALUES + 2 * HALF)
        self.rows = [
            [numbers.get(f"form_{side}_{n + 1}", nothing) for n in range(MOST_FORMS)] for side in ("left", "right")
        ]
        self.acts, self.past = [[0.0] * ACTS, [0.0] * ACTS], [[0.0] * PAST, [0.0] * PAST]
        self.loaded = any(row[1] == OVER_LOAD for rows in self.rows for row in rows)
        if not self.any:
            return
        self.ohm, self.made = numbers["winding_ohm"], [0.0, 0.0]
        self.ratio = numbers["gear_ratio"][0]
        self.torque_per_a = numbers["torque_per_current_nm_per_a"]
        self.emf = numbers["back_emf_v_s_per_rad"]
        self.wheels = [model.joint("wheel_" + side) for side in ("left", "right")]
        names = [model.joint(k).name for k in range(model.njnt)]
        self.gears = [model.joint("gear_" + side) if "gear_" + side in names else None for side in ("left", "right")]
        self.base = model.joint("base")
        tendons = [model.tendon(k).name for k in range(model.ntendon)]
        self.scrub = tendons.index("scrub") if "scrub" in tendons else None
        self.still = [float(model.dof_frictionloss[int(wheel.dofadr[0])]) for wheel in self.wheels]
        self.damping = [float(model.dof_damping[int(wheel.dofadr[0])]) for wheel in self.wheels]
        self.scrubs = float(model.tendon_frictionloss[self.scrub]) if self.scrub is not None else 0.0

    def before(self, data, asked, currents, still=None):
        """Set torques of the coming step; returns [left, right] V behind the driver at the nominal bus.

        asked : V in force, clipped; currents : A; still : N m, dry friction of the wheels without curves, where it
        changes.
        """
        if not self.any:
            return [0.0, 0.0]
        at, dof = int(self.base.qposadr[0]), int(self.base.dofadr[0])
        x, y, w, z = (float(data.qpos[at + k]) for k in (0, 1, 3, 6))
        yaw = 2.0 * math.atan2(z, w)
        speed = float(data.qvel[dof]) * math.cos(yaw) + float(data.qvel[dof + 1]) * math.sin(yaw)
        rate, about = float(data.qvel[dof + 5]), [0.0] * ABOUT
        about[9:14] = speed, float(data.time), x, y, yaw
        for k, wheel in enumerate(self.wheels):
            turns = float(data.qvel[int(wheel.dofadr[0])])
            angle = float(data.qpos[int(wheel.qposadr[0])])
            gear = self.gears[k]
            if gear is not None:
                angle += float(data.qpos[int(gear.qposadr[0])])
            current, self.made[k] = settled(self.rows[k], self.ohm[k], currents[k], self.made[k])
            past = self.past[k]
            follow(self.rows[k], asked[k], past)
            delivered = self._delivered(data, k) if self.loaded else 0.0
            remember(self.rows[k], delivered, current, self.model.opt.timestep, past)
            about[:6] = asked[k], past[DIRECTION] * abs(asked[k]), current, turns, past[GEAR_LOAD], rate
            about[6:9], about[MEAN_I] = (angle, self.ratio * angle, speed * rate), current
            act(self.rows[k], about, past, self.acts[k])
            self.acts[k][VOLTS] += back_emf(self.acts[k], self.emf[k], turns)
            self._load(data, k, turns, current, self.still[k] if still is None else still[k])
        push = self.acts[0][PUSH]
        data.qfrc_applied[dof] = push * math.cos(yaw)
        data.qfrc_applied[dof + 1] = push * math.sin(yaw)
        data.qfrc_applied[dof + 5] = self.acts[0][TURN]
        if self.scrub is not None:
            self.model.tendon_frictionloss[self.scrub] = self.scrubs + self.acts[0][SCRUB]
        return [self.acts[0][VOLTS], self.acts[1][VOLTS]]

    def _load(self, data, k, turns, current, still):
        """Torque and dry friction of a wheel that turns by `turns` rad/s."""
        acts, dof = self.acts[k], int(self.wheels[k].dofadr[0])
        # Against the way it turns; at rest, or nearly, a push either way is held by about as much.
        if turns == 0.0:
            level = still + 0.5 * (acts[FORWARD] + acts[BACKWARD])
        else:
            level = still + (acts[FORWARD] if turns > 0.0 else acts[BACKWARD])
        self.model.dof_frictionloss[dof] = max(level, 0.0)
        # As damping of the joint, which the engine takes implicitly: a lag of a step would feed or brake what swings.
        self.model.dof_damping[dof] = self.damping[k] + acts[FLUID]
        drive = acts[DRIVE] + self.torque_per_a[k] * acts[CONSTANT] * current
        # A level below none drives on what turns.
        data.qfrc_applied[dof] = drive - math.copysign(min(level, 0.0), turns)

    def _delivered(self, data, k):
        """Torque that a gear delivered to its wheel in the last step, N m: all that acts on the rotor, less what
        accelerates it."""
        dof, friction = int(self.wheels[k].dofadr[0]), 0.0
        for row in range(data.ne, data.ne + data.nf):
            if int(data.efc_id[row]) == dof and int(data.efc_type[row]) == self.FRICTION_DOF:
                friction = float(data.efc_force[row])
        acts = float(data.qfrc_actuator[dof]) + float(data.qfrc_applied[dof]) + float(data.qfrc_passive[dof])
        return acts + friction - float(self.model.dof_armature[dof]) * float(data.qacc[dof])

    def told(self, k, speed):
        """A reported wheel speed, rad/s, with what curves add to it."""
        return speed + reads(self.rows[k], W_READ[0], W_READ[1], speed)

    def readings(self, found, elapsed):
        """Add to readings, by channel, what curves of sensors do, in place; elapsed : s since the start."""
        if not self.any:
            return
        for k, side in enumerate("lr"):
            found["i_" + side] += reads(self.rows[k], I_READ[0], I_READ[1], found["i_" + side])
            found["w_" + side] = self.told(k, found["w_" + side])
        found["gyro_z"] += turns_read(self.rows[0], found["gyro_z"], elapsed)
