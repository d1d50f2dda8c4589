"""Blocks of the sensors: two channels of one quantity against each other."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis import gap
from rtds_host.diagnosis.localise.series import cumulated, filled, middles, near
from rtds_host.diagnosis.localise.signals import Signals


def speed_twice_block(run: Signals, k: int) -> None:
    """Angle against the integral of the speed."""
    s = run.robot.sides[k]
    th = run.th[k]
    if th is None or not run.has_w[k]:
        return
    rows = np.isfinite(th)
    residual = run.cut_twice(filled(run.t, th) - cumulated(run.w_mean[k], run.dt))
    rows &= run.cut_twice.whole(near(run.t, run.w_rows[k]))
    step = float(np.median(run.dt))
    between = float(np.median(np.diff(run.t[run.w_rows[k]]))) if run.w_rows[k].sum() > 2 else step
    walk = run.w_noise[k] ** 2 * between * gap.WINDOW_S / 6.0
    run.block(f"speed_twice_{s}", residual, np.sqrt(run.robot.known_noise(f"th_{s}") ** 2 + walk), rows)


def yaw_twice_block(run: Signals) -> None:
    """Yaw against the integral of the gyro."""
    if run.gyro is None or run.yaw is None:
        return
    model = run.model
    rows = np.isfinite(run.yaw)
    true = (filled(run.t, run.gyro) - model.get("gyro_bias")) / model.get("gyro_gain")
    turned = cumulated(middles(true), run.dt)
    late = model.get("measurement_delay")
    if late:
        turned = np.interp(run.t + late, run.t, turned)
    rows &= run.cut_twice.whole(near(run.t, np.isfinite(run.gyro)))
    step = float(np.median(np.diff(run.t[np.isfinite(run.gyro)])))
    walk = run.robot.known_noise("gyro_z") ** 2 * step * gap.WINDOW_S / 6.0
    run.block(
        "yaw_twice",
        run.cut_twice(filled(run.t, run.yaw) - turned),
        np.sqrt(run.robot.known_noise("yaw") ** 2 + walk),
        rows,
    )
    if not run.signatures:
        return
    run.put("sensing:gyro_gain", "yaw_twice", -run.cut_twice(turned))
    run.put("sensing:gyro_bias", "yaw_twice", -run.cut_twice(run.t))
    run.put("timing:pose", "yaw_twice", run.cut_twice(filled(run.t, run.gyro)))
