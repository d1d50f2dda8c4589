"""A seed draws the same cases as ever: whoever sealed a set can draw it again, however the drawing is written."""

import hashlib
import json

import numpy as np

from rtds_host.blind import planar, scales, vocabulary
from rtds_host.blind.cases import TIERS, WORLDS, draw_spec
from rtds_host.contract import builtin_robot

SEEDS = 25
ROBOT = builtin_robot("burger")


def rounded(value):
    """Without the last digits, which processors differ in."""
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(part) for part in value]
    return float(f"{value:.9g}") + 0.0 if isinstance(value, float) else value


def digest(value) -> str:
    return hashlib.sha256(json.dumps(rounded(value), sort_keys=True).encode()).hexdigest()[:16]


def test_a_seed_draws_the_cases_that_it_always_drew():
    drawn = [
        draw_spec(np.random.default_rng([seed, n]), tier, world)
        for world in WORLDS
        for n, tier in enumerate(TIERS)
        for seed in range(SEEDS)
    ]
    assert digest(drawn) == "1ba8e591d79746a7"


def test_a_seed_draws_the_sizes_that_it_always_drew():
    burger = scales.scale_of(ROBOT, 0.01, 16.0)
    drawn = []
    for seed, name in enumerate(vocabulary.EFFECTS):
        drawn.append(vocabulary.draw_effect(np.random.default_rng(seed), name))
        drawn.append(scales.draw_sized(np.random.default_rng(seed), name, burger))
    assert digest(drawn) == "11573e87226a1c78"


def test_a_seed_draws_the_commands_that_it_always_drew():
    t = np.arange(1001) * 0.01
    drawn = []
    for seed, name in enumerate(("steps", "coast", "prbs", "crawl", "linear", "circle", "eight", "spin", "teleop")):
        volts, speeds = planar.scenario(name, t, np.random.default_rng(seed), ROBOT)
        assert not (volts.any() and speeds.any())
        drawn += [volts.round(6).tolist(), speeds.round(6).tolist()]
    assert digest(drawn) == "dfa25502b6e635b0"
