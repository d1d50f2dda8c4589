"""The gap of the contract's section 4, written for the scorer alone (a second implementation on purpose)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

SAMPLED = ("i_l", "i_r", "w_l", "w_r", "gyro_z")


def displacements(
    t: np.ndarray, columns: Mapping[str, np.ndarray], names: tuple[str, ...], heading: np.ndarray | None
) -> dict[str, np.ndarray]:
    """How far channels move in each complete consecutive window of 1 s.

    Parameters
    ----------
    t : (n,) s. columns : name -> (n,), NaN where there is no sample. names : channels to look at.
    heading : (n,) rad, which turns x and y into the frame of the window's start; None leaves them as they are.

    Returns
    -------
    name -> (windows,), NaN for a window without a sample near (within 50 ms) one of its ends.
    """
    edges = np.arange(t[0], t[-1] + 1e-9, 1.0)

    def at_edges(values: np.ndarray) -> np.ndarray:
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            return np.full(edges.size, np.nan)
        after = np.clip(np.searchsorted(t[known], edges), 0, known.size - 1)
        before = np.clip(after - 1, 0, known.size - 1)
        near = np.where(np.abs(t[known[after]] - edges) <= np.abs(t[known[before]] - edges), after, before)
        picked = values[known[near]]
        return np.where(np.abs(t[known[near]] - edges) <= 0.05, picked, np.nan)

    marks = {name: at_edges(columns[name]) for name in names}
    result = {name: np.diff(mark) for name, mark in marks.items()}
    if heading is not None and "x" in result and "y" in result:
        angle = at_edges(heading)[:-1]
        dx, dy = result["x"], result["y"]
        result["x"] = np.cos(angle) * dx + np.sin(angle) * dy
        result["y"] = -np.sin(angle) * dx + np.cos(angle) * dy
    return result


def channel_gaps(
    t: np.ndarray, measured: Mapping[str, np.ndarray], replayed: Mapping[str, np.ndarray], noise: Mapping[str, float]
) -> dict[str, float]:
    """Error of each channel that counts, in units of its noise.

    Parameters
    ----------
    t : (n,) s. measured, replayed : channel -> (n,). noise : channel -> one standard deviation of a sample.

    Returns
    -------
    channel -> root mean square error divided by the noise (1 for a perfect replay).
    """
    gaps = {}
    for name in SAMPLED:
        if name in measured and name in noise:
            error = measured[name] - replayed[name]
            error = error[np.isfinite(error)]
            if error.size:
                gaps[name] = float(np.sqrt(np.mean(error**2)) / noise[name])

    def counts(name: str) -> bool:
        return name in measured and name in noise and bool(np.isfinite(measured[name]).any())

    wanted = [name for name in ("x", "y", "yaw") if counts(name)]
    wanted += [f"th_{s}" for s in "lr" if counts(f"th_{s}") and not counts(f"w_{s}")]
    if not wanted:
        return gaps
    # A single axis has no heading, and nothing that one would turn.
    own = measured["yaw"] if "yaw" in measured and np.isfinite(measured["yaw"]).any() else replayed.get("yaw")
    seen = displacements(t, measured, tuple(wanted), own)
    made = displacements(t, replayed, tuple(wanted), replayed.get("yaw"))
    for name in wanted:
        error = seen[name] - made[name]
        error = error[np.isfinite(error)]
        if error.size:
            gaps[name] = float(np.sqrt(np.mean(error**2)) / (noise[name] * np.sqrt(2.0)))
    return gaps


def total(gaps: Mapping[str, float]) -> float:
    """Root mean square over the channels that count; NaN where there is none."""
    return float(np.sqrt(np.mean(np.square(list(gaps.values()))))) if gaps else float("nan")
