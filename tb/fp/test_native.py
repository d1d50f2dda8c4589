"""The operators by the host's arithmetic (sim/native) against those of the RTL: results and stages, bit for bit."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from common.runner import ROOT, SIMULATORS, verilate

from fp.fp_reference import directed, random_pairs

BENCH = ("tb/fp/stage_bench.v",)
SOFT = ["rtl/fp/fp_add.v", "rtl/fp/fp_mul.v", *BENCH]
NATIVE = ["sim/native/fp_add.v", "sim/native/fp_mul.v", *BENCH]
FILLED = 3  # clocks until the first results stand
pytestmark = pytest.mark.skipif("verilator" not in SIMULATORS, reason="compiled simulation only")


def answers(sources: list[str], name: str, pairs: np.ndarray, enables: str, folder) -> np.ndarray:
    """(n, 2) uint32: sum or difference, and product, after each clock."""
    include = ["-ffp-contract=off", f"-I{ROOT / 'sim' / 'native'}", f"-I{ROOT / 'rtl' / 'fp'}"]
    program = verilate("stage_bench", sources, "tb/fp/stage_bench.cpp", name=name, options=include)
    pairs.astype("<u4").tofile(folder / "pairs.bin")
    done = subprocess.run(
        [program, folder / "pairs.bin", folder / f"{name}.bin", enables], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return np.fromfile(folder / f"{name}.bin", dtype="<u4").reshape(-1, 2)[FILLED:]


@pytest.mark.parametrize("enables", ["all", "random"])
def test_sums_and_products_of_the_host_are_those_of_the_rtl_in_every_clock(enables, tmp_path):
    pairs = np.concatenate([directed(), random_pairs(2_000_000, seed=47)])
    native = answers(NATIVE, "stage-bench-native", pairs, enables, tmp_path)
    soft = answers(SOFT, "stage-bench-soft", pairs, enables, tmp_path)
    assert len(native) == len(pairs) - FILLED
    wrong = np.flatnonzero((native != soft).any(axis=1))
    shown = [f"clock {k}: {native[k]} of the host, {soft[k]} of the RTL" for k in wrong[:5]]
    assert not len(wrong), f"{len(wrong)} clocks differ: {'; '.join(shown)}"
    assert len(np.unique(soft[:, 0])) > 100_000  # the stages did work
