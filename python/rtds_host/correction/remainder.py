"""What a diagnosis leaves, as a table: the gap shrinks even where its cause has no name.

Each block of the localisation (command and speed -> current, current -> speed) is driven by measured signals, so what
it leaves is, to first order, linear in a torque or a voltage that the model lacks. Such a torque is written as a curve
over the speed or over the wheel's angle, such a voltage as one over the command or over the current: hat functions on
fixed nodes, fitted by least squares with a mild prior on how much the curve bends (P. H. C. Eilers, B. D. Marx,
"Flexible smoothing with B-splines and penalties", 1996). The kind of table is that of the located subsystem which
explains most on blocks of time it was not fitted to.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.correction.correction import Correction
from rtds_host.diagnosis.localise.electrical import current_block
from rtds_host.diagnosis.localise.mechanical import torque_block
from rtds_host.diagnosis.localise.series import cumulated, filled, middles
from rtds_host.diagnosis.localise.signals import Signals
from rtds_host.diagnosis.replay.model import Model
from rtds_host.motor.effects import Curve, UnitEffects
from rtds_host.plant.torque import ANGLE
from rtds_host.plant.torques import TORQUES

# Kinds of table, and the subsystems whose remainder each may hold.
KINDS = {
    "torque against speed": ("drivetrain", "wheel_ground"),
    "torque against wheel angle": ("drivetrain",),
    "voltage against command": ("driver",),
    "voltage against current": ("driver", "winding"),
}
# rad/s at the wheel; closer where friction bends.
SPEED_NODES = np.array([0.0, 0.1, 0.25, 0.5, 0.9, 1.4, 2.0, 2.8, 3.8, 5.0, 6.5])
ANGLE_NODES = 48
COMMAND_NODES = 25
CURRENT_NODES = 17
# One sigma of a curve's bend from node to node, and what it is multiplied with: as rows left out say.
BEND_NM, BEND_V = 0.01, 0.1
STIFFNESSES = (0.03, 0.1, 0.3, 1.0)
# One sigma of its change from node to node, in those of its bend.
SLOPES = 3.0
# A curve itself, where nothing was seen.
SIZE_NM, SIZE_V = 0.5, 4.0
FOLD_S = 1.0
# A table is believed when it explains this share of what its block leaves above the noise, on times it was not fitted
# to.
BELIEVED = 0.3


@dataclass(frozen=True)
class Remainder:
    """A table for each side that has one.

    `kind` of `KINDS`; `curves` side "l" or "r" -> curve: N m against turning forwards over rad/s at the wheel (negative
    speeds: turning backwards), N m that drive over rad of the wheel, V beyond the command over V, or V lost over A.
    `explained`: share of the blocks' excess on times a curve was not fitted to.
    """

    kind: str
    curves: dict[str, Curve]
    explained: float
    gear_ratio: float

    def to_json(self) -> dict:
        """For close.json."""
        return {
            "kind": self.kind,
            "explained": float(f"{self.explained:.4g}"),
            "curves": {
                side: {"x": [float(f"{v:.6g}") for v in c.x], "y": [float(f"{v:.6g}") for v in c.y]}
                for side, c in self.curves.items()
            },
        }

    def load(self, correction: Correction, start: np.ndarray) -> Correction:
        """The correction with the tables in its motor units.

        Parameters
        ----------
        start : (15,) as of `run_inputs`: the wheels' angles as the run begins.

        Raises
        ------
        InputError : a motor unit cannot hold them.
        """
        left, right = (
            self._on(unit, self.curves[side], float(start[3 + k])) if side in self.curves else unit
            for k, (side, unit) in enumerate(zip("lr", correction.units, strict=True))
        )
        return replace(correction, units=(left, right))

    def _on(self, unit: UnitEffects, curve: Curve, angle: float) -> UnitEffects:
        n = self.gear_ratio
        if self.kind == "torque against speed":
            x, y = np.array(curve.x), np.array(curve.y)
            # Two points at zero, the last of the backward half and the first of the forward one.
            half = len(x) // 2
            forward = Curve(tuple(n * x[half:]), tuple(y[half:] / n))
            backward = Curve(tuple(-n * x[:half][::-1]), tuple(-y[:half][::-1] / n))
            return replace(
                unit,
                friction_forward=added(unit.friction_forward, forward),
                friction_backward=added(unit.friction_backward, backward),
            )
        if self.kind == "torque against wheel angle":
            return replace(
                unit,
                ripple=Curve(curve.x, tuple(v / n for v in curve.y)),
                ripple_periods_per_rad=1.0 / (2.0 * math.pi * n),
                ripple_start_rad=angle % (2.0 * math.pi),
            )
        if self.kind == "voltage against command":
            straight = unit.command or Curve((curve.x[0], curve.x[-1]), (curve.x[0], curve.x[-1]))
            return replace(unit, command=added(straight, curve))
        return replace(unit, drop=added(unit.drop, curve))


def added(one: Curve | None, other: Curve) -> Curve:
    """The sum of two curves, jumps kept."""
    if one is None:
        return other
    x, y = [], []
    for at in sorted({*one.x, *other.x}):
        before, after = one.before(at) + other.before(at), one.at(at) + other.at(at)
        if before != after:
            x.append(at)
            y.append(before)
        x.append(at)
        y.append(after)
    return Curve(tuple(x), tuple(y))


def _hats(values: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Hat functions on nodes, (len(values), len(nodes)); held beyond the ends."""
    at = np.clip(values, nodes[0], nodes[-1])
    right = np.clip(np.searchsorted(nodes, at, side="right"), 1, len(nodes) - 1)
    share = (at - nodes[right - 1]) / (nodes[right] - nodes[right - 1])
    out = np.zeros((len(at), len(nodes)))
    rows = np.arange(len(at))
    out[rows, right - 1] = 1.0 - share
    out[rows, right] += share
    return out


@dataclass
class _Block:
    """One side of one run: residuals and the columns of each kind, in units of noise, and the fold of each row."""

    residual: np.ndarray
    columns: dict[str, np.ndarray]
    fold: np.ndarray


def _torque_columns(s: Signals, k: int, weights: np.ndarray) -> np.ndarray:
    """Response of the torque block to torques (n - 1, m) that drive over each interval."""
    return np.column_stack([s.cut(cumulated(w, s.dt)) for w in weights.T]) / s.inertia[k]


def _volt_columns(s: Signals, k: int, end: np.ndarray, mean: np.ndarray) -> dict[str, np.ndarray]:
    """Response of the blocks to voltages, just before each row (n, m) and over each interval (n - 1, m)."""
    res = s.electric[k][0]
    if s.has_i[k]:
        return {"current": end / res[:, None]}
    return {"torque": _torque_columns(s, k, s.km[k] * mean / middles(res)[:, None])}


def _blocks(log: RunLog, robot: Robot, model: Model, k: int, tops: dict[str, float], kinds: list[str]) -> list[_Block]:
    s = Signals(log, robot, model)
    current_block(s, k)
    torque_block(s, k)
    side = robot.sides[k]
    w, sign = s.w_mean[k], middles(s.sign[k])
    by_block: dict[str, dict[str, np.ndarray]] = {"current": {}, "torque": {}}
    if "torque against speed" in kinds:
        hats = _hats(np.abs(w), SPEED_NODES)
        torques = -np.hstack([np.maximum(-sign, 0.0)[:, None] * hats[:, ::-1], np.maximum(sign, 0.0)[:, None] * hats])
        by_block["torque"]["torque against speed"] = _torque_columns(s, k, torques)
    if "torque against wheel angle" in kinds and (angle := s.th[k]) is not None:
        nodes = np.linspace(0.0, 2.0 * math.pi, ANGLE_NODES + 1)
        hats = _hats(np.mod(middles(filled(s.t, angle)), 2.0 * math.pi), nodes)
        hats[:, 0] += hats[:, -1]
        by_block["torque"]["torque against wheel angle"] = _torque_columns(s, k, hats[:, :-1])
    if "voltage against command" in kinds:
        nodes = np.linspace(-tops["volts"], tops["volts"], COMMAND_NODES)
        end, mean = s.held(s.volts[k], s.delay)
        for block, columns in _volt_columns(s, k, _hats(end, nodes), _hats(mean, nodes)).items():
            by_block[block]["voltage against command"] = columns
    if "voltage against current" in kinds:
        nodes = np.linspace(-tops["amperes"], tops["amperes"], CURRENT_NODES)
        undetermined = -_hats(s.i[k], nodes)
        for block, columns in _volt_columns(s, k, undetermined, 0.5 * (undetermined[1:] + undetermined[:-1])).items():
            by_block[block]["voltage against current"] = columns
    found = []
    for block, by_kind in by_block.items():
        if f"{block}_{side}" not in s.blocks or not by_kind:
            continue
        residual, noise, rows = s.blocks[f"{block}_{side}"]
        found.append(
            _Block(
                residual[rows] / noise[rows],
                {kind: c[rows] / noise[rows][:, None] for kind, c in by_kind.items()},
                ((s.t[rows] - s.t[0]) / FOLD_S).astype(int) % 2,
            )
        )
    return found


def _prior(kind: str, count: int, stiffness: float) -> np.ndarray:
    """Precision (m, m) of a curve's bends, and, weakly, of its size."""
    bend, size = (BEND_NM, SIZE_NM) if kind.startswith("torque") else (BEND_V, SIZE_V)
    bend *= stiffness
    parts = [np.arange(count)]
    if kind == "torque against speed":
        parts = [np.arange(count // 2), np.arange(count // 2, count)]
    precision = np.eye(count) / size**2
    for part in parts:
        rows = np.diff(np.eye(count)[part], 2, axis=0)
        if kind == "torque against wheel angle":
            eye = np.eye(count)
            rows = np.roll(eye, -1, 0) - 2.0 * eye + np.roll(eye, 1, 0)
        precision += rows.T @ rows / bend**2
        # Where nothing was seen a curve goes on level, not along its last slope.
        level = np.diff(np.eye(count)[part], axis=0)
        precision += level.T @ level / (SLOPES * bend) ** 2
    return precision


def _fit(blocks: list[_Block], kind: str, stiffness: float, fold: int | None) -> np.ndarray:
    """Heights of a curve from the rows outside a fold (all: None)."""
    count = next(b.columns[kind].shape[1] for b in blocks if kind in b.columns)
    normal, right = _prior(kind, count, stiffness), np.zeros(count)
    for b in blocks:
        if kind in b.columns:
            keep = b.fold != fold if fold is not None else np.ones(len(b.residual), bool)
            columns = b.columns[kind][keep]
            normal = normal + columns.T @ columns
            right = right + columns.T @ b.residual[keep]
    return np.linalg.solve(normal, right)


def _explained(blocks: list[_Block], kind: str, stiffness: float) -> tuple[float, float]:
    """Squares on left-out rows, above the noise: without and with the curve."""
    before = after = 0.0
    for fold in (0, 1):
        heights = _fit(blocks, kind, stiffness, fold)
        for b in blocks:
            if kind in b.columns:
                rows = b.fold == fold
                left = b.residual[rows] - b.columns[kind][rows] @ heights
                before += float(b.residual[rows] @ b.residual[rows]) - rows.sum()
                after += float(left @ left) - rows.sum()
    return before, after


def _curve(kind: str, heights: np.ndarray, tops: dict[str, float]) -> Curve:
    if kind == "torque against speed":
        return Curve((*-SPEED_NODES[::-1], *SPEED_NODES), tuple(heights))
    if kind == "torque against wheel angle":
        nodes = np.linspace(0.0, 2.0 * math.pi, ANGLE_NODES + 1)
        return Curve(tuple(nodes), (*heights, heights[0]))
    top, count = (
        (tops["volts"], COMMAND_NODES) if kind == "voltage against command" else (tops["amperes"], CURRENT_NODES)
    )
    return Curve(tuple(np.linspace(-top, top, count)), tuple(heights))


def estimate(case: Case, model: Model, diagnosis: dict) -> Remainder | None:
    """The table that explains most of what a diagnosis leaves, or None where none explains enough.

    Parameters
    ----------
    case : the runs to learn from. model : the diagnosis' robot. diagnosis : its content; `located` and `gap.rest` say
        which tables are tried.
    """
    places = [entry["subsystem"] for entry in diagnosis.get("located") or [] if entry["share"] >= 0.2]
    rest = ((diagnosis.get("gap") or {}).get("rest") or {}).get("subsystem")
    if diagnosis.get("effects"):
        places = [rest] if rest else []
    elif rest and rest not in places:
        places.append(rest)
    kinds = [kind for kind, subsystems in KINDS.items() if set(subsystems) & set(places)]
    robot = case.robot
    by_angle = [torque.size for torque in TORQUES.values() if torque.over == ANGLE]
    kinds = [
        kind
        for kind in kinds
        if not (kind == "torque against wheel angle" and any(model.get(name, k) for name in by_angle for k in (0, 1)))
    ]
    if not kinds:
        return None
    volts = max(float(np.abs(log.commands()).max()) for log in case.runs)
    currents = [np.nanmax(np.abs(log.columns[c])) for log in case.runs for c in ("i_l", "i_r") if log.has(c)]
    tops = {"volts": max(min(volts, robot.supply_v), 0.1), "amperes": max([*map(float, currents), 0.05])}
    blocks = {
        side: [b for log in case.runs for b in _blocks(log, robot, model, k, tops, kinds)]
        for k, side in enumerate(robot.sides)
    }
    best: tuple[float, str, float, float] | None = None
    for kind, stiffness in itertools.product(kinds, STIFFNESSES):
        before = after = 0.0
        for found in blocks.values():
            if any(kind in b.columns for b in found):
                one, other = _explained(found, kind, stiffness)
                before, after = before + one, after + other
        if before > 0.0 and (best is None or before - after > best[0]):
            best = (before - after, kind, stiffness, 1.0 - after / before)
    if best is None or best[3] < BELIEVED:
        return None
    _, kind, stiffness, share = best
    curves = {
        side: _curve(kind, _fit(found, kind, stiffness, None), tops)
        for side, found in blocks.items()
        if any(kind in b.columns for b in found)
    }
    return Remainder(kind, curves, float(share), robot.motor.gear_ratio)
