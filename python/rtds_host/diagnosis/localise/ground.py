"""Blocks of the ground contact: wheel speeds -> yaw rate, and wheel angles -> pose."""

from __future__ import annotations

import numpy as np

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.diagnosis import gap
from rtds_host.diagnosis.localise.series import filled, middles, smooth
from rtds_host.diagnosis.localise.signals import Signals


def turn_block(run: Signals) -> None:
    """Wheel speeds -> yaw rate, and the signatures of the ground contact and of the gyro."""
    model = run.model
    r = [model.get("radius", k) for k in (0, 1)]
    track = model.get("track")
    if run.gyro is not None and np.isfinite(run.wheel_rate).all():
        noise_gyro = run.robot.known_noise("gyro_z") / abs(model.get("gyro_gain"))
        true = (run.gyro - model.get("gyro_bias")) / model.get("gyro_gain")
        noise = np.hypot(
            noise_gyro,
            np.hypot(r[0] * np.hypot(run.w_noise[0], run.w_extra[0]), r[1] * np.hypot(run.w_noise[1], run.w_extra[1]))
            / track,
        )
        rows = np.isfinite(true) & run.w_rows[0] & run.w_rows[1]
        run.block("turn", true - run.wheel_rate, noise, rows)
    if not run.signatures:
        return
    if "turn" in run.blocks:
        run.put("sensing:gyro_gain", "turn", run.wheel_rate)
        run.put("sensing:gyro_bias", "turn", np.ones(run.n))
        run.put("chassis:track", "turn", -run.wheel_rate)
        for k, s in enumerate(run.robot.sides):
            lever = (1 if k else -1) * r[k] / track
            run.put(f"wheel_ground:radius_{s}", "turn", lever * run.w[k])
    for k in (0, 1):
        s = run.robot.sides[k]
        w = run.w[k]
        if not np.isfinite(w).all():
            continue
        run.speed_columns(f"sensing:speed_gain_{s}", k, w, True)
        run.speed_columns(f"sensing:speed_filter_{s}", k, -run.acc[k], False)
        th = run.th[k]
        if th is not None and run.has_w[k]:
            slow = smooth(np.gradient(filled(run.t, th), run.t), 2)
            run.speed_columns(f"sensing:speed_fault_{s}", k, smooth(w, 2) - slow, False)


def way_block(run: Signals) -> None:
    """Wheel angles -> how the pose moves."""
    if run.way is None or run.yaw is None:
        return
    model, t = run.model, run.t
    rows, _, _, full = run.way
    r = [model.get("radius", k) for k in (0, 1)]
    track = model.get("track")
    turned, angle_noise = [], []
    for k in (0, 1):
        s = run.robot.sides[k]
        th = run.th[k]
        if th is not None:
            turned.append(np.diff(filled(t, th)))
            angle_noise.append(run.robot.known_noise(f"th_{s}") * np.sqrt(2.0))
        else:
            turned.append(middles(run.w[k]) * run.dt)
            angle_noise.append(run.w_noise[k] * np.sqrt(gap.WINDOW_S * float(np.median(run.dt))))
    ds = 0.5 * (r[0] * turned[0] + r[1] * turned[1])
    dyaw = (r[1] * turned[1] - r[0] * turned[0]) / track
    x, y = (run.log.columns[c] if full else np.zeros(run.n) for c in ("x", "y"))
    heading = run.yaw[rows[:-1]]
    dx, dy = np.diff(x[rows]), np.diff(y[rows])
    c, s = np.cos(heading), np.sin(heading)
    measured = [np.diff(run.yaw[rows])]
    way_noise = np.hypot(r[0] * angle_noise[0], r[1] * angle_noise[1])
    noise = [np.full(len(rows) - 1, np.hypot(run.robot.known_noise("yaw") * np.sqrt(2.0), way_noise / track))]
    if full:
        measured += [c * dx + s * dy, c * dy - s * dx]
        far = np.hypot(dx, dy)
        flat = np.hypot(run.robot.known_noise("x") * np.sqrt(2.0), 0.5 * way_noise)
        noise += [np.full(len(dx), flat), np.hypot(flat, run.robot.known_noise("yaw") * far)]
    residual = np.concatenate(measured) - run.way_stack(run.way, ds, dyaw)
    where = np.tile(rows[:-1], 3 if full else 1)
    run.block("way", residual, np.concatenate(noise), where)
    if not run.signatures:
        return
    zero = np.zeros(run.n - 1)
    run.put("chassis:track", "way", run.way_stack(run.way, zero, -dyaw))
    forward = 0.5 * (r[0] * run.w[0] + r[1] * run.w[1])
    late = run.way_stack(run.way, np.diff(forward), np.diff(run.wheel_rate))
    run.put("timing:pose", "way", late)
    for k in (0, 1):
        s = run.robot.sides[k]
        run.way_columns(f"wheel_ground:radius_{s}", k, run.w[k])
        force = run.mass * 0.25 * (r[0] * run.acc[0] + r[1] * run.acc[1]) * 2
        climb = np.sin(run.slope) * np.cos(run.heading - run.log.meta.uphill_yaw_rad)
        force = (force + run.mass * GRAVITY_M_S2 * climb) * 0.5
        force = force + (1 if k else -1) * model.get("yaw_inertia") / track**2 * (r[1] * run.acc[1] - r[0] * run.acc[0])
        undetermined = -run.w[k] * force
        run.way_columns(f"wheel_ground:slip_{s}", k, undetermined)
        if run.gyro is not None:
            run.put(f"wheel_ground:slip_{s}", "turn", (1 if k else -1) * r[k] / track * undetermined)
