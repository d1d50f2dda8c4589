"""The binary32 operators against numpy's float32, bit for bit.

Every operator sees all directed pairs and a million random ones on Verilator, a hundred thousand on Icarus (the
divider, which needs 32 clocks a result, sees the last of Icarus's pairs in the long run only).
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from common.runner import SIMULATORS, VERILATOR, icarus, include_flags, read_file_list, run_cocotb, verilate

from fp.fp_reference import RESULTS, directed, expected, random_pairs

SOURCES = ["rtl/fp/fp.f", "tb/fp/fp_bench.v"]
MILLION = 1_000_000
needs_verilator = [s for s in SIMULATORS if s == "verilator"]
needs_icarus = [s for s in SIMULATORS if s == "icarus"]


def run_verilator(pairs: np.ndarray, folder: Path, stall: int = 0) -> np.ndarray:
    """(n, 11) uint32, columns as RESULTS."""
    program = verilate("fp_bench", SOURCES, "tb/fp/fp_bench.cpp")
    pairs.astype("<u4").tofile(folder / "pairs.bin")
    done = subprocess.run(
        [program, folder / "pairs.bin", folder / "out.bin", str(stall)], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return np.fromfile(folder / "out.bin", dtype="<u4").reshape(-1, len(RESULTS))


def run_icarus(pairs: np.ndarray, folder: Path, divide: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 10) results without the divider's, (divide,) quotients, (divide,) clocks they took."""
    program = icarus("fp_bench_icarus", [*SOURCES, "tb/fp/fp_bench_icarus.v"])
    (folder / "pairs.hex").write_text("\n".join(f"{a:08x}{b:08x}" for a, b in pairs.tolist()))
    subprocess.run(
        ["vvp", program, f"+pairs={folder / 'pairs.hex'}", f"+out={folder / 'out.hex'}", f"+count={len(pairs)}",
         f"+divide={divide}"],
        check=True, capture_output=True,
    )  # fmt: skip
    lines = (folder / "out.hex").read_text().splitlines()
    # An X in a result is no hexadecimal digit and raises here.
    results = np.array([[int(word, 16) for word in line.split()] for line in lines[: len(pairs)]], dtype=np.uint32)
    quotients = [line.split() for line in lines[len(pairs) :]]
    return results, np.array([int(q[0], 16) for q in quotients], np.uint32), np.array([int(q[1]) for q in quotients])


def assert_equal(pairs: np.ndarray, got: np.ndarray, want: np.ndarray, columns: tuple[str, ...]) -> None:
    for k, column in enumerate(columns):
        wrong = np.flatnonzero(got[:, k] != want[:, k])
        shown = [f"{pairs[n, 0]:08x} {pairs[n, 1]:08x}: {got[n, k]:08x}, numpy {want[n, k]:08x}" for n in wrong[:8]]
        assert not len(wrong), f"{column}: {len(wrong)} of {len(got)} differ: {'; '.join(shown)}"


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_directed_pair_equals_numpy(simulator, tmp_path):
    pairs = directed()
    assert_equal(pairs, run_verilator(pairs, tmp_path), expected(pairs), RESULTS)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_a_million_random_pairs_equal_numpy(simulator, tmp_path):
    pairs = random_pairs(MILLION, seed=20)
    assert_equal(pairs, run_verilator(pairs, tmp_path), expected(pairs), RESULTS)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_clock_enable_freezes_every_pipeline(simulator, tmp_path):
    pairs = random_pairs(20_000, seed=21)
    assert_equal(pairs, run_verilator(pairs, tmp_path, stall=3), expected(pairs), RESULTS)


def icarus_case(pairs: np.ndarray, folder: Path, divide: int) -> None:
    want = expected(pairs)
    without_div = [k for k, name in enumerate(RESULTS) if name != "div"]
    got, quotients, clocks = run_icarus(pairs, folder, divide)
    assert_equal(pairs, got, want[:, without_div], tuple(RESULTS[k] for k in without_div))
    assert_equal(pairs[:divide], quotients[:, None], want[:divide, RESULTS.index("div"), None], ("div",))
    assert set(clocks.tolist()) == {32}, "the divider's latency is fixed"


@pytest.mark.parametrize("simulator", needs_icarus)
def test_icarus_agrees_on_a_hundred_thousand_pairs(simulator, tmp_path):
    icarus_case(random_pairs(100_000, seed=23), tmp_path, divide=2_000)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_icarus)
def test_icarus_agrees_on_a_hundred_thousand_quotients_and_every_directed_pair(simulator, tmp_path):
    pairs = np.concatenate([directed(), random_pairs(100_000, seed=24)])
    icarus_case(pairs, tmp_path, divide=len(pairs))


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("operator", ["fp_add", "fp_mul"])
def test_each_stage_of_an_operator_is_enabled_for_itself(operator, simulator):
    run_cocotb(operator, [f"rtl/fp/{operator}.v"], "tb_fp_stages", "tb/fp", simulator)


@pytest.mark.parametrize("simulator", needs_verilator)
@pytest.mark.parametrize("source", [path.name for path in read_file_list("rtl/fp/fp.f")])
def test_lint_is_clean(simulator, source):
    command = [VERILATOR, "--lint-only", "-Wall", "--top-module", Path(source).stem, *include_flags(["rtl/fp/fp.f"])]
    files = [str(path) for path in read_file_list("rtl/fp/fp.f")]
    done = subprocess.run([*command, *files], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
