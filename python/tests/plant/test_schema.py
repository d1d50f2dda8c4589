"""One table of the plant's parameters, what follows from it, and the cache of what is compiled with it."""

import math
from dataclasses import fields

import numpy as np
import pytest

from rtds_host.contract import builtin_robot
from rtds_host.diagnosis.effects import SIDES, catalogue
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.export.figures import Figures, Loop, Side
from rtds_host.plant.compiled import DIGEST, KeyedCache, digest_of, loop
from rtds_host.plant.schema import COMMON, COMMON_INDEX, ENTRIES, PLACES, SIDE, SIDE_INDEX

ROBOT = builtin_robot("burger")


def test_positions_and_places_follow_the_table():
    assert list(SIDE_INDEX.values()) == list(range(len(SIDE))) and list(COMMON_INDEX.values()) == list(
        range(len(COMMON))
    )
    assert not SIDE.keys() & COMMON.keys() and PLACES.keys() == ENTRIES.keys()


def test_exported_names_are_unambiguous_and_those_that_exports_have():
    for table in (SIDE, COMMON):
        names = [entry.export for entry in table.values() if entry.export]
        assert len(names) == len(set(names))
    exported = {entry.export for entry in ENTRIES.values()}
    # What an export computes from several parameters, or has of its own.
    own = {
        "gear_nm_per_a",
        "back_emf_v_s_per_rad",
        "rotor_kg_m2",
        "dry_nm",
        "torques",
        "forms",
        "name",
        "body",
        "sides",
        "noise",
        "loop",
    }
    assert {f.name for kind in (Side, Loop, Figures) for f in fields(kind)} - exported == own


@pytest.mark.parametrize("name", ["burger", "jackal", "frc_cim"])
def test_nominal_models_and_usual_effects_lie_within_the_physical_bounds(name):
    robot = builtin_robot(name)
    models = [nominal_model(robot)]
    for effect in catalogue(robot).values():
        models.append(nominal_model(robot))
        effect.apply(models[-1], SIDES["both"], {p.name: p.starts[0] for p in effect.parameters})
    for model in models:
        for parameter, entry in ENTRIES.items():
            assert entry.low <= model.get(parameter, 0) <= entry.high, parameter
            assert entry.nominal is None or math.isfinite(entry.nominal)


def test_the_digest_follows_names_and_contents_of_the_sources(tmp_path):
    (tmp_path / "law.py").write_text("a = 1\n")
    first = digest_of(tmp_path)
    (tmp_path / "law.py").write_text("a = 2\n")
    second = digest_of(tmp_path)
    (tmp_path / "law.py").rename(tmp_path / "other.py")
    assert len({first, second, digest_of(tmp_path), DIGEST}) == 4


def test_a_compiled_loop_is_not_found_again_under_another_digest(monkeypatch, tmp_path):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))

    def doubled(x):
        return x * 2.0

    def hits():
        compiled = loop(doubled)
        assert compiled(np.float64(3.0)) == 6.0
        return sum(compiled.stats.cache_hits.values())

    assert hits() == 0 and hits() == 1
    monkeypatch.setattr(KeyedCache, "digest", "another state of the laws")
    assert hits() == 0 and hits() == 1
