"""How much of the gap lies where: a regression of all blocks on the signatures of possible errors."""

from __future__ import annotations

import functools

import numpy as np

from rtds_host.diagnosis.effects import SUBSYSTEMS
from rtds_host.diagnosis.localise.regimes import Motion, regimes
from rtds_host.diagnosis.localise.series import smooth
from rtds_host.diagnosis.localise.signals import Signals
from rtds_host.diagnosis.nuisances import MOTOR, PRIOR, SIGMAS, tolerance
from rtds_host.diagnosis.thresholds import FEWEST_SAMPLES, MAJORITY, MINOR_SHARE, QUARTER_OF_NORMAL, sigmas

# Which subsystem a block's own, unexplained residual speaks of.
BLOCKS = {
    "bus": "driver",
    "current_l": "driver",
    "current_r": "driver",
    "torque_l": "drivetrain",
    "torque_r": "drivetrain",
    "turn": "wheel_ground",
    "way": "wheel_ground",
    "speed_twice_l": "sensing",
    "speed_twice_r": "sensing",
    "yaw_twice": "sensing",
}
# Signatures of the contract's nuisances, ratios all, and what they are called among these; beyond three sigmas of its
# tolerance a ratio is a cause of its own.
NUISANCES = {
    "winding:resistance": "resistance",
    "winding:constant": "constant",
    "drivetrain:inertia": "inertia",
    "drivetrain:viscous": "viscous",
}
# Physical: a sensor's noise is known to this share of its energy; what is less, of the noise or of all there is, is not
# seen in it.
FAINT = 0.05
# The signature of a current sensor that lies in whatever way.
CURRENT_FAULT = "sensing:current_fault"
# The signature of voltages that act late, one a delay.
DELAYED = "timing:delay"
# Entries of a model by which a wheel shakes behind its gear.
LOOSE = ("backlash", "stiffness")
# Numerical: a block that has left all bounds says no more than that, in units of noise.
FARTHEST = 1e4


def group_of(cause: str) -> str:
    subsystem, name = cause.split("@")[0].split(":")
    for s in ("_lb", "_rb", "_l", "_r"):
        name = name.removesuffix(s)
    return f"{subsystem}:{name}"


def in_noise(run: Signals, b: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A block's residuals that count, over their noise, (m,); their places in the block and the rows of the log, both
    (m,).
    """
    residual, noise, rows = run.blocks[b]
    take = np.arange(len(residual)) if b == "way" else np.flatnonzero(rows)
    at = rows[take] if b == "way" else take
    z = residual[take] / noise[take]
    keep = np.isfinite(z)
    return np.clip(z[keep], -FARTHEST, FARTHEST), take[keep], at[keep]


class Sums:
    """Normal equations of all blocks and runs: `gram[block]`, `cross[block]`, `energy[block]`, `count[block]`.

    known : the model holds what was found, so that free play and springs, which a block does not know, are in it if
    anywhere.
    """

    def __init__(self, runs: list[Signals], known: bool = False):
        self.names = sorted({c for run in runs for c in run.columns})
        self.blocks = [b for b in BLOCKS if any(b in run.blocks for run in runs)]
        index = {name: j for j, name in enumerate(self.names)}
        size = len(self.names)
        self.gram = {b: np.zeros((size, size)) for b in self.blocks}
        self.cross = {b: np.zeros(size) for b in self.blocks}
        self.energy = dict.fromkeys(self.blocks, 0.0)
        self.count = dict.fromkeys(self.blocks, 0)
        self.regimes: dict[str, dict[str, list[float]]] = {b: {} for b in self.blocks}
        # One sigma of the nuisances' ratios.
        self.sigma = {
            name: tolerance(runs[0].robot, MOTOR[nuisance], PRIOR) if runs else PRIOR
            for name, nuisance in NUISANCES.items()
        }
        # Whether wheels may shake behind their gears: nothing is known of that, or they are known to.
        self.loose = not known or any(
            run.model.get(quantity, k) for run in runs for quantity in LOOSE for k in run.sides
        )
        # Noise energy that a signature takes with it, made of residuals as it is.
        self.noise_in: dict[str, float] = {}
        self.both = [0.0, 0.0, 0.0]
        self.against = [0.0, 0.0]
        for run in runs:
            which = regimes(Motion(run.t, run.w, run.heading, run.wheel_rate), run.log.meta, run.slope, run.half)
            for b in self.blocks:
                if b in run.blocks:
                    self._add(run, b, index, which)
            self._sides(run)

    def _add(self, run: Signals, b: str, index: dict[str, int], which: dict[str, np.ndarray]) -> None:
        noise = run.blocks[b][1]
        z, take, at = in_noise(run, b)
        used = [c for c in run.columns if b in run.columns[c]]
        a = np.empty((len(z), len(used)))
        for j, c in enumerate(used):
            a[:, j] = run.columns[c][b][take] / noise[take]
        a[~np.isfinite(a)] = 0.0
        for j in (j for j, c in enumerate(used) if group_of(c) == CURRENT_FAULT and b.startswith("current") and len(z)):
            # At quiet times it is the sensor's noise, coloured as it may be.
            quiet = float(np.quantile(np.abs(a[:, j]), 0.25)) / QUARTER_OF_NORMAL
            self.noise_in[CURRENT_FAULT] = self.noise_in.get(CURRENT_FAULT, 0.0) + len(z) * quiet**2
        place = [index[c] for c in used]
        self.gram[b][np.ix_(place, place)] += a.T @ a
        self.cross[b][place] += a.T @ z
        self.energy[b] += float(z @ z)
        self.count[b] += len(z)
        for regime, mask in which.items():
            inside = mask[at]
            if inside.sum() >= FEWEST_SAMPLES:
                entry = self.regimes[b].setdefault(regime, [0.0, 0])
                entry[0] += float(z[inside] @ z[inside])
                entry[1] += int(inside.sum())

    @functools.cached_property
    def _total(self) -> tuple[np.ndarray, np.ndarray]:
        """Products of all columns with each other, and with the residuals, over all blocks."""
        size = len(self.names)
        return sum(self.gram.values(), np.zeros((size, size))), sum(self.cross.values(), np.zeros(size))

    @functools.cached_property
    def groups(self) -> dict[str, list[int]]:
        """Columns that show at all, by the cause that they belong to."""
        found: dict[str, list[int]] = {}
        for j, name in enumerate(self.names):
            if self._total[0][j, j] > 0:
                found.setdefault(group_of(name), []).append(j)
        return found

    @property
    def always(self) -> list[int]:
        """Columns of the nuisances, which are in every explanation."""
        return [j for name in NUISANCES for j in self.groups.get(name, [])]

    @property
    def floor(self) -> float:
        """Energy of the noise: it is known to a few per cent only, and what no column at all can lower is not
        excess.
        """
        return sum(min(self.count[b], self.energy[b]) for b in self.blocks)

    def explained(self, columns: list[int], loose: set[int]) -> tuple[float, np.ndarray]:
        """Energy that columns explain, and their sizes: nuisances, but for those in `loose`, within their prior and
        within three sigmas of it.
        """
        nuisance = set(self.always)
        fixed = np.zeros(len(columns))
        held = np.zeros(len(columns), bool)
        tight = np.array([j in nuisance and j not in loose for j in columns], bool)
        # Numerical: a constant that is declared exact moves by next to nothing.
        sigma = np.array([max(self.sigma.get(group_of(self.names[j]), PRIOR), 1e-6) for j in columns])
        g, c = self._total[0][np.ix_(columns, columns)], self._total[1][columns]
        theta = fixed
        for _ in columns:
            free = ~held
            p = np.where(tight, sigma**-2.0, 0.0)[free]
            gf = g[np.ix_(free, free)]
            d = np.sqrt(np.diag(gf) + p)
            normal = gf / np.outer(d, d)
            normal[np.diag_indices_from(normal)] += p / d**2 + 1e-9
            theta = fixed.copy()
            theta[free] = np.linalg.solve(normal, (c[free] - g[np.ix_(free, held)] @ fixed[held]) / d) / d
            over = tight & free & (np.abs(theta) > SIGMAS * sigma)
            if not over.any():
                break
            fixed[over] = np.sign(theta[over]) * SIGMAS * sigma[over]
            held |= over
        return float(2.0 * theta @ c - theta @ g @ theta), theta

    def own(self, column: int, others: list[int]) -> float:
        """The share of a column's energy that others do not make."""
        gram = self._total[0]
        among, along = gram[np.ix_(others, others)], gram[others, column]
        # Numerical: among the others some may be one.
        among = among + 1e-9 * np.diag(np.diag(among))
        return 1.0 - float(along @ np.linalg.solve(among, along)) / float(gram[column, column])

    def _sides(self, run: Signals) -> None:
        """Do both sides' torques miss together, and do they miss against the motion?"""
        torque = {}
        for k in run.sides:
            b = f"torque_{run.robot.sides[k]}"
            if b not in run.blocks:
                return
            residual, noise, rows = run.blocks[b]
            z = np.where(rows, np.clip(residual / noise, -FARTHEST, FARTHEST), 0.0)
            push = run.columns[f"drivetrain:steady_{run.robot.sides[k]}"][b] / noise
            push = np.where(rows, push, 0.0)
            starts = run.cut.starts
            norm = np.add.reduceat(push * push, starts)
            estimate = np.add.reduceat(push * z, starts) / np.maximum(norm, 1e-12)
            estimate *= np.sqrt(norm)
            torque[k] = estimate
            motion = np.sign(np.add.reduceat(smooth(run.w[k], run.half), starts))
            big = np.abs(estimate) > sigmas(len(estimate))
            self.against[0] -= float(np.sum((estimate * np.abs(estimate) * motion)[big]))
            self.against[1] += float(np.sum(estimate[big] ** 2))
        if len(torque) == 2:
            self.both[0] += float(torque[0] @ torque[1])
            self.both[1] += float(torque[0] @ torque[0])
            self.both[2] += float(torque[1] @ torque[1])

    @property
    def together(self) -> float:
        """Correlation of both sides' missing torques, -1 to 1."""
        return self.both[0] / np.sqrt(max(self.both[1] * self.both[2], 1e-12))

    @property
    def opposing(self) -> float:
        """-1 to 1: 1 where all missing torque acts against the motion."""
        return self.against[0] / max(self.against[1], 1e-12)


def share(sums: Sums) -> tuple[dict[str, float], list[tuple[str, str, float]], float]:
    """Explain the residual energy by signatures, one at a time; the rest stays with its block."""
    names, blocks, gram, cross, energy, count = (
        sums.names,
        sums.blocks,
        sums.gram,
        sums.cross,
        sums.energy,
        sums.count,
    )
    excess = {b: max(energy[b] - count[b], 0.0) for b in blocks}
    groups = sums.groups
    # The column of a speed sensor's fault holds that sensor's noise: it counts only where the two readings disagree.
    twice = any(excess.get(f"speed_twice_{s}", 0.0) > MINOR_SHARE * count.get(f"speed_twice_{s}", 0) for s in "lr")
    located = dict.fromkeys(SUBSYSTEMS, 0.0)
    chosen: list[tuple[str, str, float]] = []
    picked: list[int] = list(sums.always)
    loose: set[int] = set()
    explained, theta = sums.explained(picked, loose)
    floor = sums.floor
    left = sum(energy.values()) - explained - floor
    whole = left
    # So small an excess may be the colour of the noise, which some columns share.
    if whole < FAINT * floor:
        return located, chosen, 0.0
    # What noise alone takes to look like one of so many signatures.
    chance = sigmas(len(groups)) ** 2
    for _ in groups:
        best = None
        for group, causes in groups.items():
            if (
                "steady" in group
                or (group == "sensing:speed_fault" and not twice)
                or any(group == g for g, _, _ in chosen)
            ):
                continue
            # Of delays one is there; all of them together would be any filter.
            for chosen_of in [[j] for j in causes] if group == DELAYED else [causes]:
                extra = [j for j in chosen_of if j not in picked]
                value, _ = sums.explained(picked + extra, loose | set(chosen_of))
                gain = value - explained - 2.0 * len(chosen_of) - sums.noise_in.get(group, 0.0)
                if best is None or gain > best[0]:
                    best = (gain, group, chosen_of, extra)
        if best is None or best[0] < max(MAJORITY * left, FAINT * whole, chance):
            break
        gain, group, causes, extra = best
        picked += extra
        loose |= set(causes)
        explained, theta = sums.explained(picked, loose)
        chosen.append((group, group.split(":")[0], min(gain / max(whole, gain), 1.0)))
        located[group.split(":")[0]] += gain
        left -= gain
    if left > FAINT * whole:
        remaining = {}
        for b in blocks:
            g = gram[b][np.ix_(picked, picked)]
            remaining[b] = max(energy[b] - 2.0 * theta @ cross[b][picked] + theta @ g @ theta - count[b], 0.0)
        scale = sum(remaining.values())
        for b, value in remaining.items():
            for subsystem, part in _owner(b, sums, excess).items():
                located[subsystem] += part * left * value / scale if scale > 0 else 0.0
    total = sum(located.values())
    located = {s: float(v / total) if total > 0 else 0.0 for s, v in located.items()}
    lag = next((float(names[j].split("@")[1]) for j in picked if group_of(names[j]) == DELAYED), 0.0)
    return located, chosen, lag


def _owner(block: str, sums: Sums, excess: dict[str, float]) -> dict[str, float]:
    """Subsystems that the unexplained rest of a block speaks of."""
    if block.startswith("torque") and len(sums.blocks) > 1 and sums.both[1] > 0:
        # What pushes the body is felt by both wheels at once, and not always against their motion.
        body = min(abs(sums.together), 1.0) ** 2 * (1.0 - max(sums.opposing, 0.0) ** 2)
        return {"chassis": body, "drivetrain": 1.0 - body}
    if block == "turn" and sums.loose and "way" in excess and excess["turn"] > 0:
        # A wheel that slips takes the pose with it; one that shakes behind its gear does not.
        slips = excess["way"] / max(sums.count["way"], 1) > FAINT * excess["turn"] / sums.count["turn"]
        return {"wheel_ground": 1.0} if slips else {"drivetrain": 1.0}
    return {BLOCKS[block]: 1.0}
