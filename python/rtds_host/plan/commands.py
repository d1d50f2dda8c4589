"""Commands over time as straight pieces between knots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Two knots this far apart are a step.
STEP_S = 1e-3
# A piece leaves the curve it stands for by at most this share of its largest value.
TOLERANCE = 0.01


@dataclass(frozen=True)
class Commands:
    """`t` (n,) s, rising, and `values` (n, 2) at these knots; straight in between. `names` are the values' columns."""

    t: np.ndarray
    values: np.ndarray
    names: tuple[str, str]

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values (m, 2) at some times (m,)."""
        return np.column_stack([np.interp(times, self.t, self.values[:, k]) for k in (0, 1)])

    def pieces(self) -> list[tuple[float, float, tuple[float, float], tuple[float, float]]]:
        """From, to, both values at the beginning and at the end, of each piece that is more than a step."""
        rows = zip(self.t, self.t[1:], self.values, self.values[1:])
        return [
            (float(a), float(b), (float(u[0]), float(u[1])), (float(v[0]), float(v[1])))
            for a, b, u, v in rows
            if b - a > 1.5 * STEP_S
        ]

    @property
    def duration_s(self) -> float:
        """When the last command is given."""
        return float(self.t[-1])


def knots(t: np.ndarray, values: np.ndarray, names: tuple[str, str], held: bool = False) -> Commands:
    """The fewest straight pieces that stay near some samples (U. Ramer 1972; D. Douglas, T. Peucker 1973).

    Parameters
    ----------
    t : (n,) s. values : (n, 2). held : each sample holds until the next one, so that a change is a step.
    """
    top = float(np.abs(values).max()) or 1.0
    if held:
        jumps = np.flatnonzero((np.abs(np.diff(values, axis=0)) > TOLERANCE * top).any(axis=1)) + 1
        # What changes at most samples is a curve.
        if len(jumps) < len(t) // 4:
            t = np.insert(t, jumps, t[jumps] - STEP_S)
            values = np.insert(values, jumps, values[jumps - 1], axis=0)
            order = np.argsort(t, kind="stable")
            t, values = t[order], values[order]
    kept = np.zeros(len(t), bool)
    kept[[0, -1]] = True
    open_pieces = [(0, len(t) - 1)]
    while open_pieces:
        a, b = open_pieces.pop()
        if b - a < 2:
            continue
        share = ((t[a + 1 : b] - t[a]) / (t[b] - t[a]))[:, None]
        away = np.abs(values[a + 1 : b] - (values[a] + share * (values[b] - values[a]))).max(axis=1)
        worst = int(np.argmax(away))
        if away[worst] > TOLERANCE * top:
            kept[a + 1 + worst] = True
            open_pieces += [(a, a + 1 + worst), (a + 1 + worst, b)]
    return Commands(t[kept], values[kept], names)
