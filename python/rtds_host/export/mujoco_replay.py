"""A recorded run once more in MuJoCo, from an exported MJCF file alone.

Nothing of the project's own models acts here: the file is loaded, the log's voltages are its controls, or its wheel
speeds those of the servo's loop, the log's channels are its sensors. What the file carries as numbers
(`custom/numeric`) is applied to commands before they are fed and to readings.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np

from rtds_host.contract import GRAVITY_M_S2, RunLog
from rtds_host.correction.correction import LEAST_BASE_SHARE
from rtds_host.errors import InputError, said_of_file
from rtds_host.export.mjcf import driver_source, forms_source
from rtds_host.plant.driver import after_bridge_drop, duty, servo
from rtds_host.plant.schema import OUTPUTS

MOTORS = ("motor_left", "motor_right")
WHEELS = ("wheel_left", "wheel_right")


@functools.cache
def driver_class() -> Any:
    """`Driver` of the module that `--actuator dcmotor` writes along, from the very text."""
    module = ModuleType("driver")
    exec(compile(driver_source(), "driver.py", "exec"), module.__dict__)
    return module.Driver


@functools.cache
def forms_class() -> Any:
    """`Forms` of the module that goes along with a file with forms, from the very text."""
    module = ModuleType("forms")
    exec(compile(forms_source(), "forms.py", "exec"), module.__dict__)
    return module.Forms


class Servo:
    """The loop of a file that is driven by wheel speeds: a PI controller with limits on its integral and its
    voltage.
    """

    def __init__(self, kp: float, ki: float, limit_v: float, period_s: float, delay_s: float):
        self.kp, self.ki, self.limit_v, self.period_s, self.delay_s = kp, ki, limit_v, period_s, delay_s
        self.integral, self.volts, self.next_s = np.zeros(2), np.zeros(2), 0.0

    def at(self, now_s: float, times: np.ndarray, asked: np.ndarray, reported: np.ndarray) -> np.ndarray:
        """Volts (2,) at a time, s.

        Parameters
        ----------
        times, asked : (n,) s and (n, 2) rad/s, the speeds asked for. reported : (2,) rad/s, the speeds that the
        encoders report.
        """
        if self.next_s <= now_s + 1e-9:
            row = int(np.searchsorted(times, now_s - self.delay_s + 1e-9, side="right")) - 1
            miss = (asked[row] if row >= 0 else 0.0) - reported
            for k in (0, 1):
                self.volts[k], self.integral[k] = servo.py_func(
                    miss[k], self.integral[k], self.kp, self.ki, self.period_s, self.limit_v, 0.0
                )
            while self.next_s <= now_s + 1e-9:
                self.next_s += self.period_s
        return self.volts


class ExportedRobot:
    """An MJCF file written by `rtds export`."""

    def __init__(self, path: Path):
        """Load a file.

        Raises
        ------
        InputError : MuJoCo does not take it, or it is no file of `rtds export`.
        """
        try:
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"{path}: {said_of_file(error)}") from error
        try:
            self.model = mujoco.MjModel.from_xml_string(text)
            self.motors = [self.model.actuator(name).id for name in MOTORS]
            self.wheels = [self.model.joint(name) for name in WHEELS]
            has_winding = bool(np.all(self.model.actuator_dyntype[self.motors] == mujoco.mjtDyn.mjDYN_DCMOTOR))
            self.winding = has_winding and any(
                self.model.numeric(k).name == "current_per_activation" for k in range(self.model.nnumeric)
            )
            current = "torque" if self.winding else "i"
            names = (f"{current}_l", f"{current}_r", "w_l", "w_r", "th_l", "th_r", "gyro", "position", "heading")
            self.sensors = {name: int(self.model.sensor(name).adr[0]) for name in names}
            self.payload = self.model.body("payload").id
            self.supply_v = float(self.model.numeric("supply_v").data[0])
        except (ValueError, KeyError) as error:
            raise InputError(
                f"{path}: is not a robot of `rtds export --to mjcf` ({' '.join(str(error).split())})"
            ) from error
        self.path = path
        self.gains = self.number("voltage_gain", 1.0)
        self.still = np.array([wheel.qposadr[0] for wheel in self.wheels])
        self.moving = np.array([wheel.dofadr[0] for wheel in self.wheels])

    def number(self, name: str, nothing: float) -> np.ndarray:
        """A pair of numbers that the file carries, or twice `nothing`."""
        ids = {self.model.numeric(k).name: k for k in range(self.model.nnumeric)}
        if name not in ids:
            return np.full(2, nothing)
        data = self.model.numeric(ids[name]).data
        return np.asarray(data if len(data) == 2 else [data[0], data[0]], dtype=float)

    def servo(self) -> Servo | None:
        """The loop that the file carries, at its start; None in a file that is driven by volts."""
        if not self.number("servo_period_s", 0.0)[0]:
            return None
        return Servo(
            *(
                float(self.number(name, 0.0)[0])
                for name in (
                    "servo_kp_v_s_per_rad",
                    "servo_ki_v_per_rad",
                    "servo_limit_v",
                    "servo_period_s",
                    "command_delay_s",
                )
            )
        )

    def _place(self, payload_kg: float, slope_rad: float, uphill_yaw_rad: float) -> None:
        """What a run says of load and ground, but for rolling resistance."""
        model = self.model
        slope = slope_rad + self.number("slope_extra_rad", 0.0)[0]
        model.opt.gravity[:] = GRAVITY_M_S2 * np.array(
            [-math.sin(slope) * math.cos(uphill_yaw_rad), -math.sin(slope) * math.sin(uphill_yaw_rad), -math.cos(slope)]
        )
        model.body_mass[self.payload] += payload_kg
        # A payload adds no yaw inertia about the axle's mid-point: where it lies next to that, the base has so much
        # less.
        base = model.body("base").id
        taken = payload_kg * float(np.sum(model.body_pos[self.payload][:2] ** 2))
        model.body_inertia[base][2] = max(
            model.body_inertia[base][2] - taken, LEAST_BASE_SHARE * model.body_inertia[base][2]
        )
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def _roll(self, payload_kg: float) -> None:
        """Rolling resistance of a run's payload."""
        rolling = self.number("rolling_coefficient", 0.0)[0] * payload_kg * GRAVITY_M_S2 * 0.5
        for wheel, dof in zip(WHEELS, self.moving, strict=True):
            self.model.dof_frictionloss[dof] += rolling * self.model.geom(wheel).size[0]

    def _start(self, start: np.ndarray) -> mujoco.MjData:
        model, data = self.model, mujoco.MjData(self.model)
        x, y, yaw = start[:3]
        radius = np.array([model.geom(name).size[0] for name in WHEELS])
        half = [abs(model.body(name).pos[1]) for name in WHEELS]
        rim = radius * start[5:7]
        data.qpos[:7] = [x, y, 0.0, math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)]
        data.qpos[self.still] = start[3:5]
        data.qvel[:2] = 0.5 * rim.sum() * np.array([math.cos(yaw), math.sin(yaw)])
        data.qvel[5] = (rim[1] - rim[0]) / sum(half)
        data.qvel[self.moving] = start[5:7]
        mujoco.mj_forward(model, data)
        # Late sensors report, until the first sample is through, what was there as the run began.
        for name in self.sensors:
            sensor = model.sensor(name).id
            if model.sensor_delay[sensor] > 0.0:
                count = int(model.sensor_history[sensor][0])
                times = (np.arange(count) - count) * model.opt.timestep
                now = self._true_reading(data, name)
                mujoco.mj_initSensorHistory(model, data, sensor, times, np.tile(now, (count, 1)), 0.0)
        return data

    def _true_reading(self, data: mujoco.MjData, name: str) -> np.ndarray:
        side = "lr".find(name[-1]) if "_" in name else -1
        if name.startswith("w_"):
            return np.array([data.qvel[self.moving[side]]])
        if name.startswith("th_"):
            return np.array([data.qpos[self.still[side]]])
        return np.array([0.0, 0.0, data.qvel[5]]) if name == "gyro" else np.zeros(1)

    def replay(self, log: RunLog, start: np.ndarray, measured_bus: np.ndarray | None = None) -> np.ndarray:
        """Drive the robot with a run's commands.

        Parameters
        ----------
        log : commands and `run.json`. start : (15,) as of `rtds_host.diagnosis.replay.model.run_inputs`.
        measured_bus : (n,) V at the log's times; the file's own supply without.

        Returns
        -------
        (n, 11) what the sensors report without noise at the log's times, columns as the replay's `OUTPUTS`.
        """
        self._place(log.meta.payload_kg, log.meta.slope_rad, log.meta.uphill_yaw_rad)
        if self.winding:
            return self._replay_winding(log, start, measured_bus)
        self._roll(log.meta.payload_kg)
        model, data = self.model, self._start(start)
        self.forms = forms_class()(model)
        usual = model.opt.timestep
        t = log.t - log.t[0]
        loop = self.servo()
        commands = self._commands(log, loop is not None)
        scale = self.number("speed_gain", 1.0)
        dead, curve = self.number("deadzone_v", 0.0), self.number("pwm_curve", 0.0)
        source, decline = self.number("source_resistance_ohm", 0.0)[0], self.number("decline_v_per_s", 0.0)[0]
        tau = self.number("speed_filter_s", 0.0)
        delay = max(float(model.sensor_delay[model.sensor("i_l").id]), 0.0)
        late = bool(model.actuator_delay[self.motors[0]] > 0.0)
        current = [self.sensors["i_l"], self.sensors["i_r"]]
        speed = [self.sensors["w_l"], self.sensors["w_r"]]
        out = np.empty((len(t), len(OUTPUTS)))
        filtered = start[5:7].copy()
        bus, yaw = self.supply_v if measured_bus is None else float(measured_bus[0]), float(start[2])
        read, seen = data.sensordata, data.sensordata[speed].copy()

        def late_filter() -> None:
            """Take the filters of the speeds to what the sensors show now."""
            for k in (0, 1):
                if tau[k] > 0.0:
                    mean = 0.5 * (seen[k] + read[speed[k]])
                    filtered[k] = mean + (filtered[k] - mean) * math.exp(-model.opt.timestep / tau[k])
            seen[:] = read[speed]

        for row in range(len(t)):
            # A row holds the state just before its command acts.
            before = self._held_currents(data) if late and delay == 0.0 else None
            mujoco.mj_forward(model, data)
            if before is not None:
                read[current] = before
            if row:
                late_filter()
            yaw = self._row(out[row], read, start, yaw, filtered, tau, float(t[row]) - delay)
            out[row, 0] = bus
            if row + 1 == len(t):
                break
            asked = commands[row]
            steps = max(1, math.ceil((t[row + 1] - t[row]) / usual - 1e-6))
            model.opt.timestep = (t[row + 1] - t[row]) / steps
            for step in range(steps):
                if loop:
                    told = data.qvel[self.moving] * scale
                    asked = loop.at(data.time, t, commands, np.array([self.forms.told(k, told[k]) for k in (0, 1)]))
                driven = self._driven(data, asked, curve, dead)
                if measured_bus is not None:
                    bus = float(measured_bus[row])
                else:
                    bus = (
                        self.supply_v
                        - decline * (data.time - delay)
                        - source * float(read[current] @ asked) / self.supply_v
                    )
                data.ctrl[self.motors] = self._less_drop(driven * bus / self.supply_v, data.qvel[self.moving])
                # MuJoCo reads its sensors before it steps: this is the end of the step before.
                mujoco.mj_step(model, data)
                if step:
                    late_filter()
        model.opt.timestep = usual
        return out

    def _commands(self, log: RunLog, speeds: bool) -> np.ndarray:
        """Commands (n, 2) of a run: V, or rad/s for a servo."""
        if speeds:
            return log.commands("speed") * self.number("command_gain", 1.0)
        return np.clip(log.commands("voltage"), -self.supply_v, self.supply_v)

    def _driven(self, data: mujoco.MjData, asked: np.ndarray, curve: np.ndarray, dead: np.ndarray) -> np.ndarray:
        """Voltages (2,) V behind the driver at a full supply, of those asked for."""
        # A driver's gain is the actuator's.
        driven = np.array([duty.py_func(asked[k], self.supply_v, curve[k], dead[k], 1.0) for k in (0, 1)])
        if self.forms.any:
            more = self.forms.before(data, [float(v) for v in asked], data.actuator_force[self.motors].tolist())
            driven += np.divide(more, self.gains, out=np.zeros(2), where=self.gains != 0.0)
        return driven

    def _replay_winding(self, log: RunLog, start: np.ndarray, measured_bus: np.ndarray | None) -> np.ndarray:
        """`replay` of a file with `<dcmotor>`: what goes along as a module acts around each step."""
        model, data = self.model, self._start(start)
        driver = driver_class()(model, log.meta.payload_kg, measured_bus is not None)
        usual, t = model.opt.timestep, log.t - log.t[0]
        commands = log.commands("speed" if driver.number("servo_period_s")[0] else "voltage")
        out = np.empty((len(t), len(OUTPUTS)))
        yaw, scale = float(start[2]), driver.number("speed_gain")
        place, heading = self.sensors["position"], self.sensors["heading"]
        for row in range(len(t)):
            if measured_bus is not None:
                driver.bus = float(measured_bus[row])
            # A row holds the state just before its command acts.
            mujoco.mj_forward(model, data)
            found, read = driver.readings(data), data.sensordata
            for k, side in enumerate("lr"):
                found[f"th_{side}"] += start[3 + k] * (1.0 - scale[k])
            found |= {"x": read[place], "y": read[place + 1]}
            found["yaw"] = yaw = yaw + math.remainder(math.atan2(read[heading + 1], read[heading]) - yaw, 2.0 * math.pi)
            out[row] = [found[name] for name in OUTPUTS]
            if row + 1 == len(t):
                break
            steps = max(1, math.ceil((t[row + 1] - t[row]) / usual - 1e-6))
            model.opt.timestep = (t[row + 1] - t[row]) / steps
            for _ in range(steps):
                driver.step(data, *commands[row])
        model.opt.timestep = usual
        return out

    def _less_drop(self, volts: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """Commands less what bridge and brushes drop against the current, which flows by what is above the back EMF."""
        drop = self.number("drop_v", 0.0)
        if not drop.any():
            return volts
        # A driver's gain acts behind the command: resistance times the actuator's gain.
        gain = self.gains
        emf = self.number("back_emf_v_s_per_rad", 0.0) * speeds
        knee, ohm = self.number("drop_knee_a", 0.0), self.number("resistance_ohm", 0.0)
        behind = after_bridge_drop.py_func
        reached = np.array([behind(gain[k] * volts[k], emf[k], drop[k], knee[k], ohm[k]) for k in (0, 1)])
        return np.where(gain == 0.0, volts, reached / np.where(gain == 0.0, 1.0, gain))

    def _held_currents(self, data: mujoco.MjData) -> np.ndarray:
        """Currents by the late commands of the step before: where one begins to act at this very time, a row does not
        show it.
        """
        step = self.model.opt.timestep
        data.time -= step
        mujoco.mj_forward(self.model, data)
        data.time += step
        return data.sensordata[[self.sensors["i_l"], self.sensors["i_r"]]].copy()

    def _row(
        self,
        row: np.ndarray,
        read: np.ndarray,
        start: np.ndarray,
        yaw: float,
        filtered: np.ndarray,
        tau: np.ndarray,
        elapsed: float,
    ) -> float:
        """Fill one row of the answer; returns the yaw, not wrapped. elapsed : s since the start, of what is read."""
        gain, bias = self.number("current_gain", 1.0), self.number("current_bias_a", 0.0)
        scale = self.number("speed_gain", 1.0)
        for k, letter in enumerate("lr"):
            row[1 + k] = read[self.sensors[f"i_{letter}"]] * gain[k] + bias[k]
            row[3 + k] = (filtered[k] if tau[k] > 0.0 else read[self.sensors[f"w_{letter}"]]) * scale[k]
            row[5 + k] = start[3 + k] + (read[self.sensors[f"th_{letter}"]] - start[3 + k]) * scale[k]
        row[7] = (
            read[self.sensors["gyro"] + 2] * self.number("gyro_gain", 1.0)[0] + self.number("gyro_bias_rad_s", 0.0)[0]
        )
        if self.forms.any:
            found = dict(zip(OUTPUTS, row.tolist(), strict=True))
            self.forms.readings(found, elapsed)
            row[:] = [found[name] for name in OUTPUTS]
        place, heading = self.sensors["position"], self.sensors["heading"]
        row[8:10] = read[place : place + 2]
        now = math.atan2(read[heading + 1], read[heading])
        row[10] = yaw + math.remainder(now - yaw, 2.0 * math.pi)
        return float(row[10])
