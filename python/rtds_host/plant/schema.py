"""The plant's parameters: one table, from which positions, places, nominal values and exported names follow.

A model of a robot is one row of `SIDE` parameters a side and one of `COMMON` ones. Effects address them by name. All
values are SI; "at the wheel" means on the wheel's side of the gear (contract, section 3).
"""

from __future__ import annotations

from rtds_host.plant.entry import LOG, REFUSED, ROBOT, RTL, SIGNAL, Entry
from rtds_host.plant.torques import TORQUES


def _table(*entries: Entry) -> dict[str, Entry]:
    found = {entry.name: entry for entry in entries}
    if len(found) < len(entries):
        raise ValueError("the schema names a parameter twice")
    return found


_MORE = {"low": 0.0}
_SHARE = {"low": 0.0, "high": 1.0}
# fmt: off
SIDE = _table(
    Entry("resistance", "ohm", None, RTL, "resistance_ohm", "winding", **_MORE),
    Entry("inductance", "H", None, RTL, "inductance_h", "winding", **_MORE),
    Entry("torque_constant", "N·m/A", None, RTL, "torque_constant_nm_per_a", "Km, at the motor's shaft"),
    Entry("back_emf", "V·s/rad", None, RTL, "back_emf_constant_v_s_per_rad", "Kb, at the motor's shaft"),
    Entry("rotor_inertia", "kg·m²", None, RTL, "rotor_inertia_kg_m2", "J, at the motor's shaft", **_MORE),
    Entry("viscous", "N·m·s/rad", None, RTL, "viscous_friction_nm_s_per_rad", "B, at the motor's shaft"),
    Entry("radius", "m", None, ROBOT, "radius_m", "wheel", **_MORE),
    Entry("pwm_curve", "1", 0.0, RTL, "pwm_curve", "relative excess of voltage at the smallest duty"),
    Entry("fast_decay", "1", 0.0, ROBOT, "fast_decay", "share of a bridge in fast decay in the voltage", **_MORE),
    Entry("pwm_periods", "1", 1.0, ROBOT, "pwm_periods", "its PWM period over L / R", **_MORE),
    Entry("voltage_gain", "1", 1.0, RTL, "voltage_gain", "driver"),
    Entry("deadzone", "V", 0.0, RTL, "deadzone_v", "driver"),
    Entry("drop", "V", 0.0, RTL, "drop_v", "against the current"),
    Entry("drop_knee", "A", 0.0, RTL, "drop_knee_a", "current at which 0.76 of the drop is reached"),
    Entry("limit", "V", 1e9, RTL, "limit_v", "largest voltage", **_MORE),
    Entry("heat_rise", "1/W", 0.0, RTL, "heat_rise_per_w", "steady relative rise of R a watt"),
    Entry("heat_tau", "s", 1e9, RTL, "heat_tau_s", "thermal time constant", **_MORE),
    Entry("coulomb", "N·m", 0.0, RTL, "coulomb_nm", "dry friction at the wheel"),
    Entry("stribeck", "N·m", 0.0, RTL, "stribeck_nm", "extra dry friction at rest"),
    Entry("stribeck_speed", "rad/s", 1.0, RTL, "stribeck_rad_s", "speed over which it fades"),
    Entry("viscous_wheel", "N·m·s/rad", 0.0, RTL, "viscous_nm_s_per_rad", "beyond the nominal B, at the wheel"),
    Entry("asymmetry", "N·m", 0.0, RTL, "asymmetry_nm", "friction forwards less backwards, halved"),
    Entry("asymmetry_viscous", "N·m·s/rad", 0.0, RTL, "asymmetry_nm_s_per_rad", "the same, by speed"),
    Entry("load_share", "1", 0.0, RTL, "load_share", "share of the torque before the loss"),
    Entry("backlash", "rad", 0.0, ROBOT, "backlash_rad", "total free play", **_MORE),
    Entry("restitution", "1", 0.0, ROBOT, "restitution", "relative speed after an impact over that before",
          **_SHARE),
    Entry("stiffness", "N·m/rad", 0.0, ROBOT, "stiffness_nm_per_rad", "gear spring; 0 = rigid", **_MORE),
    Entry("damping", "N·m·s/rad", 0.0, ROBOT, "damping_nm_s_per_rad", "gear spring", **_MORE),
    Entry("slip", "1/N", 0.0, ROBOT, "slip_per_newton", "longitudinal", **_MORE),
    Entry("slip_relaxation", "m", 0.0, ROBOT, "slip_relaxation_m", "length over which its traction builds up", **_MORE),
    Entry("slip_damping", "N·s/m", 0.0, ROBOT, "slip_damping_n_s_per_m", "of its tread", **_MORE),
    Entry("slip_grip", "1", 0.9, ROBOT, "grip", "largest traction over the load on the wheel", **_MORE),
    Entry("speed_gain", "1", 1.0, SIGNAL, "speed_gain", "sensor"),
    Entry("current_gain", "1", 1.0, SIGNAL, "current_gain", "sensor"),
    Entry("current_bias", "A", 0.0, SIGNAL, "current_bias_a", "sensor"),
    Entry("speed_tau", "s", 0.0, SIGNAL, "speed_filter_s", "sensor's low-pass filter", **_MORE),
    Entry("speed_delay", "s", 0.0, SIGNAL, "speed_delay_s", "sensor's delay beyond the others'", **_MORE),
    Entry("command_gain", "1", 1.0, REFUSED, "command_gain", "speed mode: speed asked of the loop over the command"),
    *(entry for torque in TORQUES.values() for entry in torque.entries),
)
COMMON = _table(
    Entry("gear_ratio", "1", None, RTL, "gear_ratio", "", **_MORE),
    Entry("supply", "V", None, RTL, "supply_v", "nominal", **_MORE),
    Entry("mass", "kg", None, ROBOT, "mass_kg", "without payload"),
    Entry("yaw_inertia", "kg·m²", None, ROBOT, "yaw_inertia_kg_m2", "", **_MORE),
    Entry("wheel_inertia", "kg·m²", None, ROBOT, "wheel_inertia_kg_m2", "", **_MORE),
    Entry("track", "m", None, ROBOT, "track_width_m", "", **_MORE),
    Entry("source_resistance", "ohm", 0.0, RTL, "source_resistance_ohm", "of the supply"),
    Entry("decline", "V/s", 0.0, RTL, "decline_v_per_s", "of the supply"),
    Entry("scrub", "N·m", 0.0, ROBOT, "scrub_nm", "against the yaw rate"),
    Entry("rolling", "1", 0.0, RTL, "rolling", "coefficient"),
    Entry("com_x", "m", 0.0, ROBOT, "com_x_m", ""),
    Entry("com_y", "m", 0.0, ROBOT, "com_y_m", ""),
    Entry("slope_extra", "rad", 0.0, ROBOT, "slope_extra_rad", "beyond what the run says"),
    Entry("gyro_gain", "1", 1.0, SIGNAL, "gyro_gain", "sensor"),
    Entry("gyro_bias", "rad/s", 0.0, SIGNAL, "gyro_bias_rad_s", "sensor"),
    Entry("command_delay", "s", 0.0, RTL, "command_delay_s", "", **_MORE),
    Entry("measurement_delay", "s", 0.0, SIGNAL, "measurement_delay_s", "", **_MORE),
    Entry("mode", "", None, REFUSED, "", "0 voltage, 1 torque, 2 speed"),
    Entry("torque_per_volt", "N·m/V", 0.0, REFUSED, "", "torque mode, at the motor's shaft"),
    Entry("bus_measured", "", 0.0, SIGNAL, "", "1: the bus follows v_bus of the log"),
    Entry("servo_kp", "V·s/rad", 0.0, REFUSED, "kp_v_s_per_rad", "speed mode"),
    Entry("servo_ki", "V/rad", 0.0, REFUSED, "ki_v_per_rad", "speed mode"),
    Entry("servo_limit", "V", 0.0, REFUSED, "limit_v", "speed mode"),
    Entry("servo_period", "s", 1.0, REFUSED, "period_s", "speed mode", **_MORE),
    Entry("axis", "", None, REFUSED, "", "0 robot, 1 inertia, 2 pendulum, 3 linear"),
    Entry("axis_inertia", "kg·m²", 0.0, REFUSED, "", "without mass", **_MORE),
    Entry("axis_mass", "kg", 0.0, REFUSED, "", "pendulum or carriage", **_MORE),
    Entry("axis_arm", "m", 0.0, REFUSED, "", "length, or travel a radian"),
    Entry("axis_zero", "rad", 0.0, REFUSED, "", "pendulum hanging down"),
    Entry("gyro_delay", "s", 0.0, LOG, "", "its clock behind the wheels'"),
    Entry("pose_delay", "s", 0.0, LOG, "", "its clock behind the wheels'"),
    Entry("command_early", "s", 0.0, LOG, "", "by which commands act before the row that shows them"),
    Entry("latency", "s", 0.0, SIGNAL, "", "of all samples"),
    Entry("servo_release", "1", 0.0, REFUSED, "", "speed mode: share of what the limit cuts that the integral loses"),
    Entry("encoder_at_wheel", "", 0.0, SIGNAL, "encoder_at_wheel", "1: w and th are the wheel's, 0: the gear's",
          **_SHARE),
)
# fmt: on
SIDE_INDEX = {name: k for k, name in enumerate(SIDE)}
COMMON_INDEX = {name: k for k, name in enumerate(COMMON)}
ENTRIES = {**SIDE, **COMMON}
# Where each parameter acts.
PLACES = {name: entry.place for name, entry in ENTRIES.items()}

# Columns of a replay's output, in this order.
OUTPUTS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")
OUTPUT_INDEX = {name: k for k, name in enumerate(OUTPUTS)}


def side_indices(*names: str) -> tuple[int, ...]:
    """Positions of parameters in a side's row."""
    return tuple(SIDE_INDEX[name] for name in names)


def common_indices(*names: str) -> tuple[int, ...]:
    """Positions of parameters in the row of what both sides share."""
    return tuple(COMMON_INDEX[name] for name in names)


__all__ = [
    "COMMON",
    "COMMON_INDEX",
    "ENTRIES",
    "LOG",
    "OUTPUTS",
    "OUTPUT_INDEX",
    "PLACES",
    "REFUSED",
    "ROBOT",
    "RTL",
    "SIDE",
    "SIDE_INDEX",
    "SIGNAL",
    "Entry",
    "common_indices",
    "side_indices",
]
