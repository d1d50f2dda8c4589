"""Robots drawn from what a diagnosis says of its sizes: for domain randomisation."""

from __future__ import annotations

import copy

import numpy as np

from rtds_host.contract import Robot
from rtds_host.diagnosis.effects import CATALOGUE, catalogue
from rtds_host.diagnosis.thresholds import Z90


def draw(diagnosis: dict, robot: Robot, count: int, seed: int) -> tuple[list[dict], list[str]]:
    """Diagnoses that differ in the effects' sizes.

    Each size is normal about its value, with the two sides of its 90 % interval as 1.645 standard deviations (a factor
    that cannot change its sign: its logarithm), and within the effect's bounds. Sizes are drawn independently: a
    diagnosis says nothing of their correlation.

    Parameters
    ----------
    diagnosis : content of a diagnosis.json. count : how many. seed : the same one gives the same robots.

    Returns
    -------
    The diagnoses, and the sizes that stay as they are since these runs do not pin them (or no interval is given).
    """
    rng = np.random.default_rng(seed)
    effects = catalogue(robot)
    bounds = {(name, p.name): p for name, effect in effects.items() for p in effect.parameters}
    fixed: list[str] = []
    drawn = []
    for _ in range(count):
        one = copy.deepcopy(diagnosis)
        for entry in one.get("effects") or []:
            for name, given in entry["parameters"].items():
                z = float(rng.standard_normal())
                interval = given.get("ci90") if isinstance(given, dict) else None
                if not interval:
                    label = f"{entry['id']} ({entry['side']}) {name}"
                    if label not in fixed:
                        fixed.append(label)
                    continue
                parameter = bounds[(entry["id"], name)]
                value, (low, high) = given["value"], interval
                if parameter.logarithmic and min(value, low) > 0.0:
                    edge = high if z > 0.0 else low
                    new = value * float(np.exp(abs(z) / Z90 * np.log(edge / value)))
                else:
                    edge = high if z > 0.0 else low
                    new = value + abs(z) / Z90 * (edge - value)
                # What is a share of a run's length has no bound where no run is known.
                scale = next(p.scale for p in CATALOGUE[entry["id"]].parameters if p.name == name)
                top = float("inf") if scale in ("run", "decline") else parameter.high
                given["value"] = min(max(new, 0.0 if np.isinf(top) else parameter.low), top)
        drawn.append(one)
    return drawn, fixed
