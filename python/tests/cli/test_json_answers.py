"""Every command that answers prints one JSON object with `--json`, and nothing else on standard output.

What takes minutes is put in place of itself: the demo's diagnosis, the simulator that closes a gap, the chip
behind a calibration, the diagnoser of sealed cases. Their answers are tested where they are made.
"""

import json
import re
import shutil
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rtds_host.cli.answer import answer, plain
from rtds_host.cli.commands import COMMANDS, main
from rtds_host.cli.completion import known_commands
from rtds_host.contract import builtin_robot, builtin_robot_path
from rtds_host.contract.runlog import RunMeta
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "diagnosis"))
from diagnosis_cases import example_diagnosis  # noqa: E402

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
DRIVE = ("--link", "model", "--no-compare", "--no-figure", "--duration", "0.5")
# A diagnoser that finds nothing, at once.
SILENT = """
import json, pathlib, sys
out = pathlib.Path(sys.argv[3])
out.mkdir(parents=True)
(out / "diagnosis.json").write_text(json.dumps({"schema": "rtds-diagnosis/1", "verdict": "none", "located": [],
  "effects": [], "indistinguishable": [], "alternatives": []}))
"""
# It prints a script for a shell, which is no answer.
WITHOUT = {"completion"}

# Command -> its words, in a folder with `case`, `report` and the tables below, and names that the answer must hold.
# The order counts for `blind`.
CALLS = {
    "demo": ("--out demo", {"case", "report", "diagnosis"}),
    "run": (("crawl", *DRIVE, "--out", "run"), {"runs"}),
    "run --list": ("--list", {"scenarios"}),
    "calibrate": ("--link chip --out calibration.toml", {"file", "wires"}),
    "diagnose": ("case --quick --jobs 1 --out found", {"folder", "verdict", "effects", "gap"}),
    "view": ("case --no-browser", {"address"}),
    "diff": ("report report", {"verdict", "gap", "causes"}),
    "close": ("case --diagnosis report/diagnosis.json --out closed", {"folder", "gap", "runs"}),
    "predict": ("case/steps --robot case/robot.toml --out predicted.csv", {"file", "rows", "channels", "notices"}),
    "export": ("report/diagnosis.json --robot case/robot.toml --to urdf --out robot.urdf", {"files", "effects"}),
    "export --samples": (
        "report/diagnosis.json --robot case/robot.toml --to python --samples 2 --out drawn", {"files", "samples"}
    ),
    "export --to c": ("burger --to c --out c", {"files", "effects"}),
    "serve": ("burger --port 0 --runs 1", {"robot", "address", "step_s"}),
    "webots": ("--out webots", {"folder", "worlds"}),
    "plan": ("case/robot.toml --scenario steps --out planned", {"folder", "files", "start", "largest"}),
    "effects": ("", {"effects"}),
    "init": ("mine --like burger", {"folder", "files"}),
    "doctor": ("", {"schema", "findings"}),
    "import": (f"{EXAMPLES / 'square.mcap'} --out imported", {"case", "runs"}),
    "import --list": (f"{EXAMPLES / 'rover.csv'} {EXAMPLES / 'square.mcap'} --list", {"recordings"}),
    "blind make": ("--out sealed --n 1 --tier none --world planar --jobs 1 --seed 3", {"folder", "cases"}),
    "blind answer": ("--out sealed", {"ledger", "answers"}),
    "blind score": ("--out sealed --no-closure --jobs 1", {"visible", "cases"}),
}  # fmt: skip


def documented():
    """Command -> names that docs/python.md says of its object."""
    page = (EXAMPLES.parent / "docs" / "python.md").read_text().split("names in the object |")[1].split("\n\n")[0]
    found = {}
    for line in page.splitlines()[2:]:
        _, commands, names, _ = line.split("|")
        if "several" in commands:
            continue  # tested with what only scripts need
        names = names.split("; with")[0]
        names = names.split(", each")[0].split(": the")[0].split(": a ")[0]
        for command in re.findall("`rtds (.+?)`", commands):
            found[command] = set(re.findall("`(\\w+)`", names))
    return found


def written_case(folder):
    """A run of two seconds with dry friction, by the replay, and noise."""
    from rtds_host.contract import RunLog, write_run
    from rtds_host.diagnosis.effects import SIDES, catalogue

    robot = builtin_robot("burger")
    model = nominal_model(robot)
    catalogue(robot)["coulomb_friction"].apply(model, SIDES["both"], {"torque_nm": 0.05})
    t = np.arange(401) * 0.005
    rng = np.random.default_rng(1)
    volts = np.where(t[:, None] < 0.2, 0.0, rng.uniform(-9.0, 9.0, (5, 2))[(t / 0.5).astype(int)])
    log = RunLog("steps", RunMeta(scenario="steps"), t, {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]})
    out = replay_run(model, run_inputs(log, robot), 2e-4)
    columns = {name: out[:, k] + robot.noise(name) * rng.standard_normal(len(t)) for k, name in enumerate(OUTPUTS)}
    folder.mkdir()
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    write_run(folder / "steps", log.meta, {"t": t, **log.columns, **columns})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a case and a diagnosis."""
    folder = tmp_path_factory.mktemp("answers")
    written_case(folder / "case")
    (folder / "report").mkdir()
    (folder / "report" / "diagnosis.json").write_text(json.dumps(example_diagnosis()))
    (folder / "silent.py").write_text(SILENT)
    return folder


@pytest.fixture
def in_place(monkeypatch, folder):
    """What takes minutes, or waits for Ctrl-C or a connection."""
    import rtds_host.cli.calibrate as calibrate
    import rtds_host.view.command
    from rtds_host.blind import seal
    from rtds_host.correction import close
    from rtds_host.diagnosis import batch
    from rtds_host.link.analog import Paths
    from rtds_host.link.calibrate import Measured
    from rtds_host.native import serve

    class Rig:
        def set_parameters(self, *constants, step_s):
            assert len(constants) == 6 and step_s == 1e-5

    class Never:
        def wait(self):
            raise KeyboardInterrupt

    monkeypatch.setattr(calibrate, "open_link", lambda link, **options: nullcontext(Rig()))
    closed = {"gap": {"before": np.float64(4.0), "after": float("nan")}, "runs": ["steps"]}
    monkeypatch.setattr(close, "close_folder", lambda *_, **options: SimpleNamespace(content=closed))
    monkeypatch.setattr(calibrate, "measure", lambda rig, *_: Measured(Paths(), np.zeros(8)))
    # Of this module alone: threads of others wait for events, too.
    monkeypatch.setattr(rtds_host.view.command, "threading", SimpleNamespace(Event=Never))
    monkeypatch.setattr(serve, "serve_runs", lambda *_: None)
    answer_cases, run_one = seal.answer, batch.run_one
    command = [sys.executable, str(folder / "silent.py")]
    monkeypatch.setattr(seal, "answer", lambda *given, **named: answer_cases(*given, command=command, **named))

    def one(case, out, **options):
        # The demo's case is three bags.
        return ({"verdict": "none"}, None) if case.parent.name == "demo" else run_one(case, out, **options)

    monkeypatch.setattr(batch, "run_one", one)


def said(words, monkeypatch, capfd):
    monkeypatch.setattr(sys, "argv", ["rtds", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capfd.readouterr()
    return ended.value.code, out, err


@pytest.mark.parametrize("call", CALLS)
def test_an_answer_is_one_json_object_and_nothing_else(call, folder, in_place, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    words, names = CALLS[call]
    command = call.split()[:2] if call.startswith("blind") else call.split()[:1]
    status, out, err = said(
        [*command, *(words.split() if isinstance(words, str) else words), "--json"], monkeypatch, capfd
    )
    assert status == 0, err
    content = json.loads(out)
    assert isinstance(content, dict) and names <= set(content)
    assert documented().get(call, set()) <= set(content)


def test_no_command_that_answers_is_left_out():
    known = known_commands()
    answering = {f"{name} {child}" for name, one in known.items() for child in one.commands}
    answering |= {name for name, one in known.items() if not one.commands} - WITHOUT
    assert {name for name in answering if " " in name} | {c.split()[0] for c in CALLS} >= answering
    assert answering <= {" ".join(c.split()[:2]) if c.startswith("blind") else c.split()[0] for c in CALLS}
    assert set(COMMANDS) >= WITHOUT
    assert {" ".join(one.split(" --")[:1]) for one in documented()} == answering
    for name in answering:
        command, _, child = name.partition(" ")
        one = known[command].commands[child] if child else known[command]
        assert "--json" in one.options, name


def test_what_cannot_be_answered_is_a_line_and_no_json(folder, monkeypatch, capfd):
    status, out, err = said(["diff", str(folder / "report"), str(folder / "nowhere"), "--json"], monkeypatch, capfd)
    assert (status, out) == (2, "") and err.startswith("rtds: ") and err.count("\n") == 1


def test_numbers_that_are_not_finite_and_arrays_are_plain(capsys):
    answer(
        {"a": float("nan"), "b": np.array([1.0, np.inf]), "c": Path("x") / "y", "d": (np.int64(3), None), "é\udcff": 1}
    )
    out = capsys.readouterr().out
    assert json.loads(out) == {"a": None, "b": [1.0, None], "c": "x/y", "d": [3, None], "é\udcff": 1}
    assert out.isascii() and plain({1: {2}}) == {"1": [2]}
