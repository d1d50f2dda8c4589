"""What a person can cause ends in one line and status 2: names, values, files and options that are none."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rtds_host
from rtds_host.cli.commands import main
from rtds_host.compat import tomllib
from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, write_run
from rtds_host.diagnosis.predict import DIAGNOSIS_SCHEMAS, predicted_columns
from rtds_host.errors import OutputError


@pytest.fixture
def case(tmp_path):
    """A small case, right in every respect: a second of a spin, all channels."""
    folder = tmp_path / "case"
    folder.mkdir()
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    t = np.arange(100) * 0.01
    commands = {"v_cmd_l": -5.0 * np.sin(6.0 * t), "v_cmd_r": 5.0 * np.sin(6.0 * t)}
    columns = predicted_columns(RunLog("spin", RunMeta("spin"), t, commands), builtin_robot("burger"))
    write_run(folder / "spin", RunMeta("spin"), columns)
    return folder


@pytest.fixture
def rtds(monkeypatch, capfd):
    """Call the command; (status, what it printed, the lines it said on standard error)."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rtds", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return ended.value.code, out, err.splitlines()

    return call


def test_escape_codes_of_a_name_are_spelled_out(rtds, tmp_path):
    status, _, said = rtds("diagnose", tmp_path / "\x1b[31mred\nand more\udcff", "--out", tmp_path / "out")
    assert status == 2
    assert said == [rf"rtds: {tmp_path}/\x1b[31mred and more\udcff: is not a case folder"]


# ---- names that are none -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "{case}", "--out", ""),
        ("diagnose", "{case}", "--out="),
        ("predict", "{run}", "--robot", "", "--out", "p.csv"),
        ("predict", "{run}", "--robot", "{robot}", "--out", ""),
        ("run", "linear", "--link", "model", "--out", ""),
        ("import", "x.csv", "--mapping", "", "--out", "o"),
        ("close", "{case}", "--out", ""),
        ("blind", "make", "--out", ""),
        ("blind", "answer", "--out="),
        ("diagnose", "", "--out", "o"),
    ],
)
def test_an_empty_name_is_not_the_folder_one_is_in(rtds, case, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    status, _, said = rtds(*(a.format(case=case, run=case / "spin", robot=case / "robot.toml") for a in arguments))
    assert status == 2 and len(said) == 1 and said[0].endswith("is empty")
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("command", ["diagnose", "close"])
@pytest.mark.parametrize("place", [".", "spin"])
def test_a_name_that_is_no_text_is_refused_before_any_work(rtds, case, tmp_path, command, place):
    (case / place).resolve().rename((case / place).resolve().with_name("n\udce9"))
    folder = tmp_path / "n\udce9" if place == "." else case
    status, _, said = rtds(command, folder, "--out", tmp_path / "out")
    assert status == 2 and len(said) == 1 and said[0].endswith(r"n\udce9 is not a name in UTF-8; rename the folder")
    assert not (tmp_path / "out").exists()


NEITHER_FILE_NOR_FOLDER = [
    ("predict", "{bad}", "--robot", "{robot}", "--out", "{out}"),
    ("predict", "{run}", "--robot", "{bad}", "--out", "{out}"),
    ("predict", "{run}", "--robot", "{robot}", "--diagnosis", "{bad}", "--out", "{out}"),
    ("predict", "{run}", "--robot", "{robot}", "--out", "{bad}"),
    ("diagnose", "{bad}", "--out", "{out}"),
    ("diagnose", "{case}", "--out", "{bad}"),
    ("diagnose", "{case}", "{run}", "--out", "{bad}"),
    ("close", "{bad}", "--out", "{out}"),
    ("close", "{case}", "--out", "{bad}"),
    ("run", "standstill", "--link", "model", "--out", "{bad}"),
    ("run", "standstill", "--link", "model", "--robot", "{bad}", "--out", "{out}"),
    ("import", "{bad}", "--out", "{out}"),
    ("import", "{bad}", "--mapping", "rtds", "--out", "{out}"),
    ("import", "{case}/spin/log.csv", "--mapping", "{bad}", "--out", "{out}"),
    ("blind", "answer", "--out", "{bad}"),
    ("blind", "score", "--out", "{bad}"),
    ("blind", "make", "--n", "1", "--out", "{bad}"),
]
# A prediction goes to a pipe or a device as to a file, so that these are no bad place for it.
WRITABLE = ("predict", "{run}", "--robot", "{robot}", "--out", "{bad}")


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (kind, arguments)
        for kind in ("a link to itself", "a pipe", "a device")
        for arguments in NEITHER_FILE_NOR_FOLDER
        if kind == "a link to itself" or arguments != WRITABLE
    ],
)
def test_what_is_no_file_and_no_folder_is_refused_at_once(rtds, case, tmp_path, kind, arguments):
    bad = tmp_path / "bad"
    if kind == "a link to itself":
        bad.symlink_to(bad)
    elif kind == "a pipe":
        os.mkfifo(bad)
    else:
        bad = Path("/dev/zero")
    before = sorted(tmp_path.rglob("*"))
    names = {"bad": bad, "case": case, "run": case / "spin", "robot": case / "robot.toml", "out": tmp_path / "out"}
    status, _, said = rtds(*(a.format(**names) for a in arguments))
    assert status == 2 and len(said) == 1
    assert "internal error" not in said[0] and "bad" in said[0] or "/dev/zero" in said[0]
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("place", ["spin/run.json", "spin/log.csv", "robot.toml"])
def test_a_pipe_within_a_case_is_named_and_not_waited_for(rtds, case, tmp_path, place):
    (case / place).unlink()
    os.mkfifo(case / place)
    for arguments in (("diagnose", case), ("predict", case / "spin", "--robot", case / "robot.toml")):
        status, _, said = rtds(*arguments, "--out", tmp_path / "out")
        assert (
            status == 2
            and len(said) == 1
            and "internal error" not in said[0]
            and str(case / place.split("/")[0]) in said[0]
        )
    assert not (tmp_path / "out").exists()


def test_results_of_many_do_not_fall_into_one_of_them(rtds, case, tmp_path):
    shutil.copytree(case, tmp_path / "other")
    status, _, said = rtds("diagnose", case, tmp_path / "other", "--out", case)
    assert status == 2 and said == [f"rtds: {case}: is an input of this very command; choose another folder"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "{case}", "--out", "{case}"),
        ("diagnose", "{case}", "--out", "{case}/spin"),
        ("diagnose", "{case}", "--out", "{link}"),
        ("diagnose", "{case}", "--out", "{out}", "--mcap", "{case}/robot.toml"),
        ("diagnose", "{case}", "--out", "{out}", "--mcap", "{link}/spin/log.csv"),
        ("diagnose", "{case}", "--out", "{out}", "--mcap", "{out}/diagnosis.json"),
        ("diagnose", "{case}", "{case}/../other", "--out", "{case}"),
        ("diagnose", "{case}", "{case}/../other", "--out", "{case}/.."),
        ("diagnose", "{case}", "{case}/../other", "--out", "{case}/spin"),
        ("close", "{case}", "--out", "{case}"),
        ("close", "{case}", "--out", "{case}/spin"),
        ("close", "{case}", "--diagnosis", "{said}/diagnosis.json", "--out", "{said}"),
        ("predict", "{case}/spin", "--robot", "{case}/robot.toml", "--out", "{link}/spin/log.csv"),
        ("predict", "{case}/spin", "--robot", "{case}/robot.toml", "--out", "{case}/spin/log.parquet"),
        ("predict", "{case}/spin", "--robot", "{case}/robot.toml", "--out", "{hard}"),
        ("export", "{said}/diagnosis.json", "--robot", "{case}/robot.toml", "--to", "mjcf", "--out", "{hard}"),
        (
            "export",
            "{said}/diagnosis.json",
            "--robot",
            "{case}/robot.toml",
            "--to",
            "mjcf",
            "--out",
            "{case}/spin/log.csv",
            "--check",
            "{case}/spin",
        ),
        ("plan", "{said}/plan.json", "--robot", "{case}/robot.toml", "--out", "{said}"),
        ("calibrate", "--link", "chip", "--wires", "{said}/diagnosis.json", "--out", "{said}/diagnosis.json"),
        ("import", "{case}/spin/log.csv", "--mapping", "rtds", "--out", "{case}"),
        ("blind", "make", "--measured", "{case}", "--out", "{case}"),
        ("blind", "make", "--measured", "{case}", "--out", "{case}/spin"),
    ],
)
def test_no_output_takes_the_place_of_what_it_is_made_from(rtds, case, tmp_path, arguments):
    """In one line before the work, by whatever name or link, and nothing is written."""
    shutil.copytree(case, tmp_path / "other")
    (tmp_path / "link").symlink_to(case)
    os.link(case / "robot.toml", tmp_path / "hard")
    (tmp_path / "said").mkdir()
    for name in ("diagnosis.json", "plan.json"):
        (tmp_path / "said" / name).write_text(
            json.dumps({"schema": DIAGNOSIS_SCHEMAS[0], "verdict": "none", "effects": []})
        )
    before = {path: path.read_bytes() if path.is_file() else None for path in tmp_path.rglob("*")}
    names = {"case": case, "out": tmp_path / "out", **{name: tmp_path / name for name in ("link", "hard", "said")}}
    began = time.process_time()
    status, _, said = rtds(*(a.format(**names) for a in arguments))
    assert status == 2 and len(said) == 1
    assert (
        "exists already" if arguments[0] == "import" else "is an input of this very command; choose another f"
    ) in said[0]
    assert time.process_time() - began < 5.0  # modules load; a diagnosis takes longer
    assert {path: path.read_bytes() if path.is_file() else None for path in tmp_path.rglob("*")} == before


@pytest.mark.parametrize("place", [".", "spin"])
@pytest.mark.parametrize("read", [False, True], ids=["its folder", "as read"])
def test_the_function_diagnose_does_not_write_into_its_case_either(case, place, read):
    before = sorted(case.rglob("*"))
    with pytest.raises(OutputError, match="is an input of this very command"):
        rtds_host.diagnose(rtds_host.read_case(case) if read else case, out=case / place)
    assert sorted(case.rglob("*")) == before


def test_a_full_place_for_what_is_printed_is_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "rtds_host.cli.main", "effects"],
            check=False,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2 and done.stderr == "rtds: No space left on device\n"


# ---- values --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("column", range(14))
def test_a_value_of_1e308_in_a_log_is_named(rtds, case, tmp_path, column):
    """Refused with its row (a time: with the row after it), or set aside with a notice."""
    path = case / "spin" / "log.csv"
    lines = path.read_text().splitlines()
    cells = lines[7].split(",")
    cells[column] = "1e308"
    lines[7] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    status, _, said = rtds("predict", case / "spin", "--robot", case / "robot.toml", "--out", tmp_path / "p.csv")
    assert status in (0, 2) and len(said) == 1
    assert lines[0].split(",")[column] in said[0] and "internal error" not in said[0]
    assert (tmp_path / "p.csv").exists() == (status == 0)


def numbers_of_a_robot():
    for section, values in tomllib.loads(builtin_robot_path("burger").read_text()).items():
        if isinstance(values, dict):
            yield from ((section, key) for key in values)


@pytest.mark.parametrize(("section", "key"), [*numbers_of_a_robot()])
@pytest.mark.parametrize("value", ["1e308", "-1e308", "nan", "inf", "9" * 400])
def test_an_impossible_value_in_a_robot_is_named_by_its_key(rtds, case, tmp_path, section, key, value):
    path = case / "robot.toml"
    text = re.sub(rf"^{key}\s*=.*$", f"{key} = {value}", path.read_text(), flags=re.MULTILINE)
    path.write_text(text)
    status, _, said = rtds("predict", case / "spin", "--robot", path, "--out", tmp_path / "p.csv")
    assert status == 2 and len(said) == 1 and f"robot.toml: [{section}] {key}: is " in said[0]
    assert not (tmp_path / "p.csv").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "{case}"),
        ("predict", "{case}/spin", "--robot", "{case}/robot.toml"),
        ("export", "{said}", "--robot", "{case}/robot.toml", "--to", "mjcf"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_mass_farther_off_the_axle_than_the_yaw_inertia_allows_is_refused_by_each_command(
    rtds, case, tmp_path, arguments
):
    path = case / "robot.toml"
    path.write_text(re.sub(r"^com_y_m\s*=.*$", "com_y_m = 0.5", path.read_text(), flags=re.MULTILINE))
    said_before = tmp_path / "diagnosis.json"
    said_before.write_text(json.dumps({"schema": DIAGNOSIS_SCHEMAS[0], "verdict": "none", "effects": []}))
    names = {"case": case, "said": said_before}
    status, _, said = rtds(*(a.format(**names) for a in arguments), "--out", tmp_path / "out")
    assert status == 2 and len(said) == 1
    assert "robot.toml: [chassis] com_y_m: is 0.5, " in said[0] and "yaw_inertia_kg_m2" in said[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("delimiter", ["", ",,", '"', "\\n", "."])
def test_a_delimiter_that_is_none_is_named(rtds, tmp_path, delimiter):
    (tmp_path / "log.csv").write_text("t,a\n0,1\n1,2\n")
    (tmp_path / "m.toml").write_text(
        f"""schema = "rtds-mapping/1"\nname = "m"\n[table]\ndelimiter = '{delimiter}'\n"""
        if delimiter != "\\n"
        else 'schema = "rtds-mapping/1"\nname = "m"\n[table]\ndelimiter = "\\n"\n'
    )
    status, _, said = rtds("import", tmp_path / "log.csv", "--mapping", tmp_path / "m.toml", "--out", tmp_path / "out")
    assert status == 2 and len(said) == 1 and "m.toml: [table]: delimiter is" in said[0]


# ---- a diagnosis to apply ------------------------------------------------------------------------------------------

COULOMB = {"id": "coulomb_friction", "side": "left", "parameters": {"torque_nm": 0.05}}


@pytest.mark.parametrize(
    ("diagnosis", "words"),
    [
        ({}, "d.json: effects: missing"),
        ({"effects": None}, "d.json: effects: is None, a list is needed"),
        (
            {"effects": [COULOMB, COULOMB]},
            r"d.json: effects[1]: coulomb_friction on this side is in effects[0] already",
        ),
        ({"effects": [{**COULOMB, "side": "both"}, COULOMB]}, "d.json: effects[1]: coulomb_friction on this side"),
        (
            {"effects": [{"id": "payload_error", "side": "both", "parameters": {"mass_kg": -1.0}}]},
            "parameters.mass_kg: is -1, it must lie",
        ),
        (
            {"effects": [{"id": "com_offset", "side": "both", "parameters": {"x_m": 0.0, "y_m": 0.15}}]},
            "log.csv: a yaw inertia of",
        ),
    ],
)
def test_a_diagnosis_that_cannot_be_applied_is_refused(rtds, case, tmp_path, diagnosis, words):
    (tmp_path / "d.json").write_text(json.dumps({"schema": DIAGNOSIS_SCHEMAS[0], **diagnosis}))
    status, _, said = rtds(
        "predict",
        case / "spin",
        "--robot",
        case / "robot.toml",
        "--diagnosis",
        tmp_path / "d.json",
        "--out",
        tmp_path / "p.csv",
    )
    assert status == 2 and len(said) == 1 and words in said[0]
    assert not (tmp_path / "p.csv").exists()


def test_one_effect_on_either_side_is_applied(rtds, case, tmp_path):
    both = {"effects": [COULOMB, {**COULOMB, "side": "right"}]}
    (tmp_path / "d.json").write_text(json.dumps({"schema": DIAGNOSIS_SCHEMAS[0], **both}))
    status, _, said = rtds(
        "predict",
        case / "spin",
        "--robot",
        case / "robot.toml",
        "--diagnosis",
        tmp_path / "d.json",
        "--out",
        tmp_path / "p.csv",
    )
    assert (status, said) == (0, []) and (tmp_path / "p.csv").is_file()
