"""Single axes made for tests: a motor with a load, integrated on its own, shares nothing with the replay.

Steps of 0.1 ms; the current is implicit, dry friction sticks. A case is written in the contract's format.
"""

import math

import numpy as np

from rtds_host.contract import RunMeta, write_run

H = 1e-4
G = 9.80665
GEAR = 50.0
MOTOR = {
    "resistance_ohm": 4.0,
    "inductance_h": 1e-3,
    "torque_constant_nm_per_a": 0.01,
    "back_emf_constant_v_s_per_rad": 0.01,
    "rotor_inertia_kg_m2": 4e-7,
    "viscous_friction_nm_s_per_rad": 2e-6,
    "gear_ratio": GEAR,
}
AXES = {
    "inertia": {"inertia_kg_m2": 2e-3},
    "pendulum": {"mass_kg": 0.3, "length_m": 0.1},
    "linear": {"mass_kg": 4.0, "metres_per_rad": 0.02},
}
SERVO = {"kp_v_s_per_rad": 0.8, "ki_v_per_rad": 8.0, "limit_v": 12.0, "period_s": 2e-3}
NOISE = {"i_a": 0.004, "w_rad_s": 0.01, "th_rad": 0.0001}
TORQUE_PER_VOLT = 0.0025


def robot_toml(kind, mode, bus="nominal", ki=SERVO["ki_v_per_rad"]):
    """The nominal machine of a kind ("inertia", "pendulum", "linear") and a mode ("voltage", "torque", "speed")."""
    tables = {
        "motor": dict(MOTOR),
        "supply": {"voltage_v": 12.0},
        "driver": {"mode": mode, "bus": bus},
        "axis": {"kind": kind, **AXES[kind]},
        "sensors": NOISE,
    }
    if mode == "torque":
        tables["driver"]["torque_nm_per_v"] = TORQUE_PER_VOLT
        for key in ("resistance_ohm", "inductance_h", "torque_constant_nm_per_a", "back_emf_constant_v_s_per_rad"):
            del tables["motor"][key]
    if mode == "speed":
        tables["servo"] = {**SERVO, "ki_v_per_rad": ki}
    lines = ['schema = "rtds-robot/1"', 'name = "axis"']
    for name, table in tables.items():
        lines += [f"[{name}]"] + [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v!r}" for k, v in table.items()]
    return "\n".join(lines) + "\n"


def simulate(
    kind,
    mode,
    command,
    seconds,
    *,
    gain=1.0,
    resistance=1.0,
    constant=1.0,
    coulomb=0.0,
    viscous=0.0,
    load=1.0,
    delay_s=0.0,
    rate=250,
    th0=0.2,
    ki=SERVO["ki_v_per_rad"],
):
    """What an axis does on a command (a function of time); t (n,), columns noiseless.

    gain, resistance, constant and load (mass or inertia) are ratios, coulomb N·m and viscous N·m·s/rad at the output,
    delay_s the delay of all measured columns; ki that of the servo in speed mode.
    """
    r, kt = MOTOR["resistance_ohm"] * resistance, MOTOR["torque_constant_nm_per_a"] * constant
    inertia = {
        "inertia": lambda a: a["inertia_kg_m2"],
        "pendulum": lambda a: a["mass_kg"] * a["length_m"] ** 2,
        "linear": lambda a: a["mass_kg"] * a["metres_per_rad"] ** 2,
    }[kind](AXES[kind]) * load
    weight = AXES[kind]["mass_kg"] * load * G * AXES[kind]["length_m"] if kind == "pendulum" else 0.0
    total = inertia + GEAR**2 * MOTOR["rotor_inertia_kg_m2"]
    damping = GEAR**2 * MOTOR["viscous_friction_nm_s_per_rad"] + viscous
    rows = int(seconds * rate) + 1
    every, lag = round(1 / (rate * H)), round(delay_s / H)
    steps = (rows - 1) * every + 1
    th, w, i, held = th0, 0.0, 0.0, 0.0
    integral, volts = 0.0, 0.0
    history, commands = np.empty((steps, 3)), np.empty(rows)
    for k in range(steps):
        if k % every == 0:
            held = float(f"{command(k * H):.6g}")
            commands[k // every] = held
        history[k] = i, w, th
        if mode == "speed":
            if k % round(SERVO["period_s"] / H) == 0:
                error = held - w
                integral += ki * error * SERVO["period_s"]
                volts = min(max(SERVO["kp_v_s_per_rad"] * error + integral, -12.0), 12.0)
        else:
            volts = held if mode == "torque" else min(max(held, -12.0), 12.0)
        if mode == "torque":
            drive = gain * volts * TORQUE_PER_VOLT * GEAR
        else:
            i = (MOTOR["inductance_h"] * i + H * (gain * volts - kt * GEAR * w)) / (MOTOR["inductance_h"] + H * r)
            drive = kt * GEAR * i
        free = w + H * (drive - damping * w - weight * math.sin(th)) / total
        grip = H * coulomb / total
        before, w = w, 0.0 if abs(free) <= grip else free - math.copysign(grip, free)
        th += 0.5 * H * (before + w)
    seen = history[np.maximum(np.arange(rows) * every - lag, 0)]
    columns = {
        ("w_cmd_l" if mode == "speed" else "v_cmd_l"): commands,
        "i_l": seen[:, 0],
        "w_l": seen[:, 1],
        "th_l": seen[:, 2],
    }
    if mode != "voltage":
        del columns["i_l"]
    return np.arange(rows) / rate, columns


def commands(kind, mode, seed):
    """Three manoeuvres that move an axis both ways, slowly and quickly, and stop it: functions of time."""
    rng = np.random.default_rng(seed)
    size = {"voltage": 5.0, "torque": 6.0 if kind == "pendulum" else 2.5, "speed": 6.0}[mode]
    levels = rng.uniform(-1, 1, 64)
    a, b = rng.uniform(1.5, 3.0), rng.uniform(4.0, 7.0)
    return {
        "sines": lambda t: size * (0.7 * math.sin(a * t) + 0.3 * math.sin(b * t)),
        "steps": lambda t: size * levels[int(t / 0.35)],
        "ramps": lambda t: size * (2 * abs((t / 1.3) % 2 - 1) - 1) * (0 if t > 3.2 else 1),
    }


def write_axis_case(folder, kind, mode, seed=1, seconds=4.0, bus="nominal", currents=True, noisy=True, **truth):
    """A case of three runs of an axis that has what `truth` (of `simulate`) says; returns the folder."""
    rng = np.random.default_rng(seed + 100)
    folder.mkdir(parents=True)
    (folder / "robot.toml").write_text(robot_toml(kind, mode, bus, truth.get("ki", SERVO["ki_v_per_rad"])))
    for name, command in commands(kind, mode, seed).items():
        t, columns = simulate(kind, mode, command, seconds, **truth)
        for channel, noise in (("i_l", NOISE["i_a"]), ("w_l", NOISE["w_rad_s"]), ("th_l", NOISE["th_rad"])):
            if channel in columns and noisy:
                columns[channel] = columns[channel] + noise * rng.standard_normal(len(t))
        if not currents:
            columns.pop("i_l", None)
        if bus == "measured":
            columns["v_bus"] = np.full(len(t), 12.0)
        write_run(folder / name, RunMeta(scenario=name), {"t": t, **columns})
    return folder
