"""Logs as loggers leave them: cut in a cell, counted since 1970, a million rows long; files that unpack to anything."""

import json
import re
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rtds_host.contract import RunMeta, builtin_robot_path, read_case, read_run, runlog, write_run
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError

HEADER = "t,v_cmd_l,v_cmd_r,w_l,w_r\n"


@pytest.fixture
def run(tmp_path):
    (tmp_path / "robot.toml").write_text(builtin_robot_path("burger").read_text())
    folder = tmp_path / "run-1"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps(RunMeta("steps").to_json()))
    return folder


def rows(count, w=lambda k: f"{0.001 * k:.6f}"):
    return [f"{0.01 * k:.2f},1,1,{w(k)},{w(k)}" for k in range(count)]


# ---- a row cut inside its last cell --------------------------------------------------------------------------------


@pytest.mark.parametrize("left", [0, 1, 3, 7])
def test_a_row_cut_inside_its_last_cell_is_set_aside_with_a_notice(run, left):
    text = HEADER + "\n".join(rows(20))
    (run / "log.csv").write_text(text[: len(text) - 8 + left])
    log = read_run(run)
    assert len(log.t) == 19 and log.notices == ("log.csv: row 21 ends inside its last cell, it is set aside",)
    assert log.columns["w_r"][-1] == 0.018


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0.1,1,1,0.001,0", "time goes back"),
        (",1,1,0.001,0", "t is missing"),
        ("0.2,x,1,0.001,0", "v_cmd_l is 'x'"),
        ("0.2,1,1,1e308,0", "w_l is 1e+308"),
    ],
)
def test_a_cut_row_hides_nothing_that_is_wrong_with_it(run, row, words):
    (run / "log.csv").write_text(HEADER + "\n".join(rows(20)) + "\n" + row)
    with pytest.raises(InputError, match=re.escape(words)):
        read_run(run)


def test_rows_are_counted_without_the_cut_one(run):
    (run / "log.csv").write_text(HEADER + "\n".join(rows(2))[:-1])
    with pytest.raises(InputError, match="has 1 rows"):
        read_run(run)


def test_a_time_in_the_last_column_may_be_the_cut_cell(run):
    (run / "log.csv").write_text(
        "v_cmd_l,v_cmd_r,w_l,t\n" + "\n".join(f"1,1,0.1,{0.01 * k:.2f}" for k in range(20))[:-2]
    )
    assert len(read_run(run).t) == 19


def test_a_whole_row_without_an_end_is_kept(run):
    (run / "log.csv").write_text(HEADER + "\n".join(rows(20)))
    log = read_run(run)
    assert len(log.t) == 20 and log.notices == ()


def test_a_short_last_cell_that_is_ended_is_kept(run):
    (run / "log.csv").write_text(HEADER + "\n".join(rows(20)) + "\n0.3,1,1,0,0\n")
    assert len(read_run(run).t) == 21


def test_the_last_row_is_judged_by_rows_of_an_earlier_block(run, monkeypatch):
    monkeypatch.setattr(runlog, "BLOCK_BYTES", 200)
    text = HEADER + "\n".join(rows(50))
    (run / "log.csv").write_text(text[:-3])
    assert len(read_run(run).t) == 49


# ---- blocks --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [7, 64, 1000])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_a_log_reads_alike_in_blocks_of_any_size(run, monkeypatch, size, ends):
    body = rows(40, lambda k: "" if k % 7 == 3 else f" {0.1 * k:.3g} ")
    body[11:11] = [""]
    (run / "log.csv").write_bytes(("\ufeff" + HEADER + "\n".join(body) + "\n").replace("\n", ends).encode())
    whole = read_run(run)
    monkeypatch.setattr(runlog, "BLOCK_BYTES", max(size, 40))
    parts = read_run(run)
    assert len(whole.t) == 40 and np.isnan(whole.columns["w_l"][3]) and whole.columns["w_l"][20] == 2.0
    for c in whole.columns:
        assert np.array_equal(whole.columns[c], parts.columns[c], equal_nan=True)


@pytest.mark.parametrize(
    ("row", "text", "words"),
    [
        (30, "0.28,1,1,x,0", "row 30: w_l is 'x', not a number"),
        (30, "0.28,1,1,0", "row 30: has 4 cells"),
        (30, "0.01,1,1,0,0", "row 30: time goes back"),
        (30, "0.28,1,1,inf,0", "row 30: w_l is inf"),
        (30, "0.28,1,1,\udce4,0", "is not text"),
    ],
)
def test_a_complaint_names_the_row_in_a_later_block(run, monkeypatch, row, text, words):
    monkeypatch.setattr(runlog, "BLOCK_BYTES", 100)
    lines = [HEADER.strip(), *rows(60)]
    lines[row - 1] = text
    data = ("\n".join(lines) + "\n").encode(errors="surrogateescape")
    (run / "log.csv").write_bytes(data)
    with pytest.raises(InputError, match=words) as error:
        read_run(run)
    if "text" in words:
        assert f"byte {data.index(0xE4)}" in str(error.value)


# ---- times ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_times_since_1970_keep_their_microseconds_and_replay_alike(run, form):
    t = np.arange(500) * 0.005
    v = np.sin(t)
    columns = {"v_cmd_l": v, "v_cmd_r": -v, "w_l": 0 * v, "w_r": 0 * v}
    replays = []
    for origin in (0.0, 1_700_000_000.0, -3.0):
        write_run(run, RunMeta(), {"t": t + origin, **columns}, form)
        case = read_case(run.parent)
        log = case.runs[0]
        assert np.abs(log.t - log.t[0] - t).max() < 1e-6
        replays.append(replay_run(nominal_model(case.robot), run_inputs(log, case.robot)))
    assert np.allclose(replays[0], replays[1], atol=1e-6) and np.allclose(replays[0], replays[2], atol=1e-9)


def test_times_with_too_few_digits_are_told_from_a_clock_that_stands(run):
    (run / "log.csv").write_text(HEADER + "1.70000e9,1,1,0,0\n1.70000e9,1,1,0,0\n")
    with pytest.raises(InputError, match="too few digits for times since 1970"):
        read_run(run)


@pytest.mark.parametrize(("factor", "unit"), [(1e6, "microseconds"), (1e9, "nanoseconds")])
def test_a_clock_in_another_unit_is_named_when_it_is_read(run, factor, unit):
    (run / "log.csv").write_text(HEADER + "".join(f"{0.005 * k * factor:.0f},1,1,0,0\n" for k in range(500)))
    with pytest.raises(InputError, match=rf"is it in {unit}\?"):
        read_run(run)


def test_volts_in_thousands_are_named(run):
    (run / "log.csv").write_text(HEADER + "0,1,1,0,0\n0.01,11000,1,0,0\n")
    with pytest.raises(InputError, match=r"row 3: v_cmd_l is 11000, .*in millivolts\?"):
        read_run(run)


@pytest.mark.parametrize("count", [11, 5])
def test_short_and_slow_logs_are_readable(run, count):
    (run / "log.csv").write_text(HEADER + "\n".join(f"{0.1 * k:.1f},1,1,0.1,0.1" for k in range(count)) + "\n")
    assert len(read_run(run).t) == count


# ---- size ----------------------------------------------------------------------------------------------------------


def test_a_parquet_file_that_would_unpack_to_too_much_is_refused_before(run, monkeypatch):
    """Millions of zeros are a few thousand bytes; the file says so itself."""
    monkeypatch.setattr(runlog, "LARGEST_BYTES", 2**24)
    table = pa.table({c: np.zeros(1_000_000) for c in ("t", "v_cmd_l", "v_cmd_r", "w_l")})
    pq.write_table(table, run / "log.parquet", compression="zstd")
    assert (run / "log.parquet").stat().st_size < 50_000
    monkeypatch.setattr(pq.ParquetFile, "read", lambda *_, **__: pytest.fail("it was unpacked"))
    with pytest.raises(InputError, match=r"log\.parquet: would unpack to 0\.0298 GiB \(1000000 rows\)"):
        read_run(run)


def test_a_csv_that_is_too_long_is_refused_while_it_is_read(run, monkeypatch):
    monkeypatch.setattr(runlog, "LARGEST_BYTES", 5 * 8 * 1000)
    monkeypatch.setattr(runlog, "BLOCK_BYTES", 1000)
    (run / "log.csv").write_text(HEADER + "\n".join(rows(1200)) + "\n")
    with pytest.raises(InputError, match="too long"):
        read_run(run)


def test_a_row_without_an_end_is_no_log(run, monkeypatch):
    monkeypatch.setattr(runlog, "BLOCK_BYTES", 100)
    (run / "log.csv").write_text(HEADER + "1" * 1000)
    with pytest.raises(InputError, match="longer than 100 characters"):
        read_run(run)


def test_a_log_of_half_a_million_rows_is_read_within_bounded_memory(run):
    """Numbers are 20 MB here; reading must not need many times that next to what the program itself takes."""
    count = 500_000
    body = "".join(f"{0.01 * k:.2f},1.5,-1.5,{0.001 * (k % 977):.6f},0.25\n" for k in range(count))
    (run / "log.csv").write_text(HEADER + body)
    code = (
        "import resource, sys; from rtds_host.contract import read_run\n"
        "import pyarrow.csv, pyarrow.parquet\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "rows = len(read_run(sys.argv[1]).t)\n"
        "print(rows, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(run)], capture_output=True, text=True, check=True)
    number, kib = map(int, done.stdout.split())
    assert number == count and kib < 120_000


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_reading_a_log_loads_no_pandas(tmp_path, form):
    """It is no dependency. Where it is installed, Arrow's own way to NumPy would load it, which takes longer than many
    logs; cells without a sample are NaN all the same."""
    t = np.arange(50) * 0.01
    w = np.where(np.arange(50) % 3 == 0, np.nan, np.sin(t))
    write_run(tmp_path / "run", RunMeta("x"), {"t": t, "v_cmd_l": t, "v_cmd_r": t, "w_l": w}, form=form)
    code = (
        "import sys; from rtds_host.contract import read_run\n"
        "print(*read_run(sys.argv[1]).columns['w_l'].tolist(), 'pandas' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "run")], capture_output=True, text=True, check=True
    )
    *values, loaded = done.stdout.split()
    np.testing.assert_allclose(np.array(values, float), w, rtol=1e-6)
    assert loaded == "False"
