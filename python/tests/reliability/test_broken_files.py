"""A stranger's broken file gets its one line before any work begins, and a sound one of any size is read."""

import os
import shutil
import signal
import subprocess
import sys
import tracemalloc

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rtds_host.contract import (
    RunLog,
    RunMeta,
    builtin_robot,
    builtin_robot_path,
    load_robot,
    read_case,
    read_run,
    write_run,
)
from rtds_host.contract.inputs import MOST_PARTS, longest_key, read_toml
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.gate.rounding import step_of
from rtds_host.diagnosis.predict import predicted_columns
from rtds_host.diagnosis.ripple import spectra
from rtds_host.errors import LONGEST_MESSAGE, InputError, listed, shown
from rtds_host.importers.mapping import load_mapping
from rtds_host.importers.table import Table


@pytest.fixture(scope="module")
def sound():
    """A run of the nominal burger with its sensors' noise: name -> (300,)."""
    robot, rng = builtin_robot("burger"), np.random.default_rng(1)
    t = np.arange(300) * 0.01
    commands = {"v_cmd_l": 6.0 * np.sign(np.sin(4.0 * t)), "v_cmd_r": 5.0 * np.sign(np.sin(6.0 * t + 1.0))}
    columns = predicted_columns(RunLog("run", RunMeta(), t, commands), robot)
    return {c: v + (robot.noise(c) or 0.0) * rng.standard_normal(300) for c, v in columns.items()}


@pytest.fixture
def case(tmp_path, sound):
    folder = tmp_path / "case"
    folder.mkdir()
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    write_run(folder / "run", RunMeta(), sound)
    return folder


def refusal(read, *arguments):
    with pytest.raises(InputError) as refused:
        read(*arguments)
    assert len(str(refused.value)) <= LONGEST_MESSAGE + 100 and "\n" not in str(refused.value)
    return str(refused.value)


# ---- numbers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("channel", "value"), [("th_l", 1e7), ("th_r", -9e8), ("w_l", -1e8), ("gyro_z", 1e8), ("i_r", 1e6)]
)
@pytest.mark.parametrize("row", [0, 150, 299])
def test_one_absurd_sample_is_set_aside_with_a_notice_and_changes_no_noise(tmp_path, sound, channel, value, row):
    folder = tmp_path / "case"
    folder.mkdir()
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    columns = {c: v.copy() for c, v in sound.items()}
    columns[channel][row] = value
    write_run(folder / "run", RunMeta(), columns)
    gate = examine(read_case(folder))
    told = [f for f in gate.findings if f.channel == channel and f.kind in ("glitch", "start")]
    assert len(told) == 1 and np.isnan(gate.case.runs[0].columns[channel][row])
    assert gate.case.robot.noise(channel) < 1.5 * builtin_robot("burger").noise(channel)


def test_the_step_of_a_channel_is_that_of_its_values_and_not_of_one_glitch():
    rng = np.random.default_rng(2)
    values = np.round(rng.normal(0.0, 1.0, 500), 1)
    values[7] = 1e8
    assert step_of(values) == pytest.approx(0.1)


def test_so_many_turns_that_no_spectrum_is_fine_enough_have_none():
    class Problem:
        robot = builtin_robot("burger")
        runs = ()

    log = RunLog("run", RunMeta(), np.arange(50) * 0.01, {c: np.arange(50.0) * 1e7 for c in ("th_l", "w_l")})
    Problem.runs = (type("Run", (), {"log": log}),)
    out = np.ones((50, 11)) * np.arange(50.0)[:, None]
    assert spectra(Problem, [out]) == {}


def test_times_closer_than_a_nanosecond_s_tenth_are_no_seconds(case):
    log = read_run(case / "run")
    write_run(case / "run", RunMeta(), {"t": log.t * 1e-298, **log.columns})
    assert "row 3: t is 1e-300, 1e-300 s after the row before: is it in seconds?" in refusal(read_case, case)


# ---- width, depth, rows ----------------------------------------------------------------------------------------------


def test_a_hundred_thousand_extra_columns_are_read_and_said_in_one_notice(case):
    path = case / "run" / "log.csv"
    head, *rows = path.read_text().splitlines()[:20]
    extra = ",".join(f"c{k}" for k in range(100_000))
    path.write_text("\n".join([f"{head},{extra}", *(row + ",1" * 100_000 for row in rows)]) + "\n")
    told = read_run(case / "run").notices
    assert len(told) == 1 and "100000 columns are not in the format, ignored: c0, c1" in told[0] and len(told[0]) < 200


@pytest.mark.parametrize("reader", ["contract", "import"])
def test_a_header_of_a_million_commas_is_refused_by_its_first_double_name(case, tmp_path, reader):
    path = case / "run" / "log.csv"
    path.write_text("t" + "," * 1_000_000 + "\n1\n")
    mapping = tmp_path / "mapping.toml"
    mapping.write_text('schema = "rtds-mapping/1"\n[time]\ncolumn = "t"\n')
    said = refusal(read_run, case / "run") if reader == "contract" else refusal(Table, path, load_mapping(mapping))
    assert "row 1: column '' appears twice" in said


def test_a_key_of_fifty_thousand_parts_is_refused_before_it_is_parsed(case):
    path = case / "robot.toml"
    path.write_text(path.read_text() + "\n" + ".".join("a" * 50_000) + " = 1\n")
    tracemalloc.start()
    try:
        said = refusal(load_robot, path)
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()
    assert f"a key has 50000 dotted parts, at most {MOST_PARTS} are read" in said


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('a.b.c = "x.y.z.w" # a.b.c.d.e.f', 3),
        ("[a . 'x.y' . \"p.q\"]", 3),
        ('n = """a.b\n.c.d.e.f\\" """\nx.y = 1.5', 2),
        ("m = '''a.b.c.d'''", 1),
        ("a = 1", 1),
    ],
)
def test_dots_count_in_keys_and_not_in_texts_or_comments(text, parts):
    assert longest_key(text)[0] == parts


def test_dots_in_a_comment_refuse_no_file(case):
    path = case / "robot.toml"
    path.write_text("# " + "." * 200 + "\n" + path.read_text())
    assert load_robot(path).name == builtin_robot("burger").name


def test_a_file_of_settings_of_megabytes_is_refused(tmp_path):
    (tmp_path / "robot.toml").write_text("# " + "x" * 300_000)
    assert "is longer than 0.25 MiB, the most that is read" in refusal(read_toml, tmp_path / "robot.toml")


def test_twenty_million_equal_rows_are_refused_by_the_second_one(case):
    (case / "run" / "log.csv").unlink()
    zeros = pa.array(np.zeros(20_000_000))
    table = pa.table({name: zeros for name in ("t", "v_cmd_l", "v_cmd_r", "w_l")})
    pq.write_table(table, case / "run" / "log.parquet", compression="zstd")
    del table, zeros
    assert "row 2: time goes back or stands still" in refusal(read_run, case / "run")


def test_parquet_is_read_whole_over_several_batches(case, monkeypatch, sound):
    from rtds_host.contract import runlog

    monkeypatch.setattr(runlog, "BATCH_ROWS", 64)
    write_run(case / "run", RunMeta(), sound, "parquet")
    log = read_run(case / "run")
    assert all(np.array_equal(log.columns[c], sound[c]) for c in log.columns) and len(log.t) == 300


def test_a_loop_of_ten_microseconds_is_replayed_in_steps_that_end(tmp_path):
    text = builtin_robot_path("burger").read_text()
    path = tmp_path / "robot.toml"
    servo = "\n[servo]\nkp_v_s_per_rad = 1.0\nki_v_per_rad = 5.0\nlimit_v = 12.0\nperiod_s = 1e-5\n"
    servo += '[driver]\nmode = "speed"\n'
    path.write_text(text + servo)
    robot = load_robot(path)
    assert robot.servo.period_s == 1e-4 and any("replayed in steps of 0.0001 s" in told for told in robot.notices)


# ---- messages --------------------------------------------------------------------------------------------------------


def test_a_value_of_a_megabyte_is_not_repeated(case):
    path = case / "robot.toml"
    text = path.read_text()
    path.write_text(text.replace("mass_kg", 'mass_kg = "' + "9" * 100_000 + '"\n#', 1))
    assert len(refusal(load_robot, path)) < 400 + len(str(path))
    path.write_text(text)
    log = case / "run" / "log.csv"
    rows = log.read_text().splitlines()
    rows[4] = "x" * 100_000 + rows[4][rows[4].index(",") :]
    log.write_text("\n".join(rows) + "\n")
    assert len(refusal(read_run, case / "run")) < 400 + len(str(path))


def test_what_a_message_repeats_is_cut_and_numbers_without_end_are_said():
    assert shown("x" * 1000).endswith("… (1000 characters)") and len(shown("x" * 1000)) < 120
    assert shown(16**5000) == "a whole number of 20001 bits" and shown(True) == "True" and shown([1, "a"]) == "[1, 'a']"
    assert listed([f"c{k}" for k in range(1000)]).endswith("c29 and 970 more")
    assert len(str(InputError("p: " + "v" * 10**6))) < LONGEST_MESSAGE + 100


def test_a_control_character_in_a_name_is_spelled_out_before_it_comes_into_an_xml_file(case, tmp_path):
    path = case / "robot.toml"
    path.write_text(
        'name = "a\\u0001b"\n' + "\n".join(r for r in path.read_text().splitlines() if not r.startswith("name"))
    )
    robot = load_robot(path)
    assert robot.name == "a\\x01b" and any("name holds characters" in told for told in robot.notices)
    path.write_text(path.read_text().replace("a\\u0001b", "x" * 10_000))
    assert "a text of at most 200 characters is needed" in refusal(load_robot, path)


# ---- signals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("asked", "said"), [(signal.SIGTERM, "ended by a signal"), (signal.SIGINT, "interrupted")])
def test_a_batch_that_is_ended_by_a_signal_says_so_and_leaves_no_semaphore(case, tmp_path, asked, said):
    for k in range(3):
        shutil.copytree(case, tmp_path / f"case{k}")
    program = (
        "import os, signal, sys, threading, time\n"
        "from rtds_host import workers\n"
        "from rtds_host.cli.main import main\n"
        "made = workers.process_pool\n"
        "def pool(count):\n"
        f"    threading.Timer(0.5, lambda: os.kill(os.getpid(), {int(asked)})).start()\n"
        "    return made(count)\n"
        "workers.process_pool = pool\n"
        "if __name__ == '__main__':\n"
        "    main()\n"
    )
    (tmp_path / "ended.py").write_text(program)
    cases = [str(tmp_path / f"case{k}") for k in range(3)]
    done = subprocess.run(
        [sys.executable, "ended.py", "diagnose", *cases, "--out", "out"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        timeout=300,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert (done.returncode, done.stderr.strip()) == (128 + asked, f"rtds: {said}")
