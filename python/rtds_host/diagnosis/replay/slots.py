"""The numbers a replay runs on, by name: one row a side and one row for what both sides share.

The kernel sees two flat arrays; effects address their entries by the names below, never by number.
All values are SI. "At the wheel" means on the wheel's side of the gear, as in the contract, section 3.
"""

from __future__ import annotations

# name -> (value of the nominal robot or None where robot.toml gives it, unit, meaning)
SIDE = {
    "resistance": (None, "ohm", "winding"),
    "inductance": (None, "H", "winding"),
    "torque_constant": (None, "N·m/A", "Km, at the motor's shaft"),
    "back_emf": (None, "V·s/rad", "Kb, at the motor's shaft"),
    "rotor_inertia": (None, "kg·m²", "J, at the motor's shaft"),
    "viscous": (None, "N·m·s/rad", "B, at the motor's shaft"),
    "radius": (None, "m", "wheel"),
    "pwm_curve": (0.0, "1", "relative excess of voltage at the smallest duty"),
    "voltage_gain": (1.0, "1", "driver"),
    "deadzone": (0.0, "V", "driver"),
    "drop": (0.0, "V", "against the current"),
    "limit": (1e9, "V", "largest voltage"),
    "heat_rise": (0.0, "1/W", "steady relative rise of R a watt"),
    "heat_tau": (1e9, "s", "thermal time constant"),
    "coulomb": (0.0, "N·m", "dry friction at the wheel"),
    "stribeck": (0.0, "N·m", "extra dry friction at rest"),
    "stribeck_speed": (1.0, "rad/s", "speed over which it fades"),
    "viscous_wheel": (0.0, "N·m·s/rad", "beyond the nominal B, at the wheel"),
    "asymmetry": (0.0, "N·m", "friction forwards less backwards, halved"),
    "asymmetry_viscous": (0.0, "N·m·s/rad", "the same, by speed"),
    "load_share": (0.0, "1", "share of the torque before the loss"),
    "backlash": (0.0, "rad", "total free play"),
    "restitution": (0.0, "1", "relative speed after an impact of its flanks over that before"),
    "stiffness": (0.0, "N·m/rad", "gear spring; 0 = rigid"),
    "damping": (0.0, "N·m·s/rad", "gear spring"),
    "ripple": (0.0, "N·m", "amplitude"),
    "ripple_cycles": (1.0, "1/rev", "of the wheel"),
    "ripple_phase": (0.0, "rad", ""),
    "slip": (0.0, "1/N", "longitudinal"),
    "slip_relaxation": (0.0, "m", "length over which its traction builds up"),
    "slip_damping": (0.0, "N·s/m", "of its tread"),
    "slip_grip": (0.9, "1", "largest traction over the load on the wheel"),
    "speed_gain": (1.0, "1", "sensor"),
    "current_gain": (1.0, "1", "sensor"),
    "current_bias": (0.0, "A", "sensor"),
    "speed_tau": (0.0, "s", "sensor's low-pass filter"),
    "speed_late": (0.0, "s", "sensor's delay beyond the others'"),
}
# New entries go last, here and above: a compiled kernel is kept by the date of kernel.py, and holds indices.
COMMON = {
    "gear_ratio": (None, "1", ""),
    "supply": (None, "V", "nominal"),
    "mass": (None, "kg", "without payload"),
    "yaw_inertia": (None, "kg·m²", ""),
    "wheel_inertia": (None, "kg·m²", ""),
    "track": (None, "m", ""),
    "source_resistance": (0.0, "ohm", "of the supply"),
    "decline": (0.0, "V/s", "of the supply"),
    "scrub": (0.0, "N·m", "against the yaw rate"),
    "rolling": (0.0, "1", "coefficient"),
    "com_x": (0.0, "m", ""),
    "com_y": (0.0, "m", ""),
    "slope_extra": (0.0, "rad", "beyond what the run says"),
    "gyro_gain": (1.0, "1", "sensor"),
    "gyro_bias": (0.0, "rad/s", "sensor"),
    "command_delay": (0.0, "s", ""),
    "measurement_delay": (0.0, "s", ""),
    "mode": (None, "", "0 voltage, 1 torque, 2 speed"),
    "torque_per_volt": (0.0, "N·m/V", "torque mode, at the motor's shaft"),
    "bus_measured": (0.0, "", "1: the bus follows v_bus of the log"),
    "servo_kp": (0.0, "V·s/rad", "speed mode"),
    "servo_ki": (0.0, "V/rad", "speed mode"),
    "servo_limit": (0.0, "V", "speed mode"),
    "servo_period": (1.0, "s", "speed mode"),
    "axis": (None, "", "0 robot, 1 inertia, 2 pendulum, 3 linear"),
    "axis_inertia": (0.0, "kg·m²", "without mass"),
    "axis_mass": (0.0, "kg", "pendulum or carriage"),
    "axis_arm": (0.0, "m", "length, or travel a radian"),
    "axis_zero": (0.0, "rad", "pendulum hanging down"),
    "gyro_late": (0.0, "s", "its clock behind the wheels'"),
    "pose_late": (0.0, "s", "its clock behind the wheels'"),
    "latency": (0.0, "s", "of all samples"),
    "servo_release": (0.0, "1", "speed mode: share of what the limit cuts by which the integral gives way"),
    "command_early": (0.0, "s", "by which commands act before the row that shows them, as a logger writes them"),
}
SIDE_INDEX = {name: k for k, name in enumerate(SIDE)}
COMMON_INDEX = {name: k for k, name in enumerate(COMMON)}

# Columns of a replay's output, in this order.
OUTPUTS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")
OUTPUT_INDEX = {name: k for k, name in enumerate(OUTPUTS)}
