"""Whether two answers have the same names, and how the copies are made that ask for it."""

import json
import sys

import numpy as np
import pytest

from rtds_host.blind import steady
from rtds_host.contract import RunMeta, builtin_robot, builtin_robot_path, read_case, write_run
from rtds_host.errors import InputError


def answer(*names, sets=(), left=3.0, without=5.0):
    effects = [{"id": name, "side": "both", "gap_without": without} for name in names]
    groups = [[{"id": name, "side": "both"} for name in group] for group in sets]
    return {"verdict": "partial", "effects": effects, "indistinguishable": groups, "gap": {"after": left}}


@pytest.fixture
def case(tmp_path):
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "robot.toml").write_bytes(builtin_robot_path("burger").read_bytes())
    t = np.arange(0, 1.0, 0.01)
    for name in ("a", "b", "c"):
        columns = {"t": t, "v_cmd_l": 5 + 0 * t, "v_cmd_r": 5 + 0 * t, "w_l": t, "w_r": t}
        write_run(folder / name, RunMeta(scenario=name), columns)
    return folder


@pytest.fixture
def diagnoser(tmp_path, monkeypatch):
    """Puts a script in the place of the diagnoser, which says what an expression gives for a case folder, `place`."""

    def put(says):
        script = tmp_path / "diagnoser.py"
        script.write_text(
            "import json, sys\nfrom pathlib import Path\nfrom rtds_host.contract import load_robot, read_case\n"
            "place, out = Path(sys.argv[1]), Path(sys.argv[3])\n"
            f"answer = {says}\n"
            "out.mkdir(parents=True)\n(out / 'diagnosis.json').write_text(json.dumps(answer))\n"
        )
        monkeypatch.setattr(steady, "diagnoser_command", lambda quick, threads: [sys.executable, str(script)])
        return script

    return put


def test_names_are_the_same_where_each_is_named_or_declared_in_the_other():
    assert steady.same(answer("supply_sag"), answer("supply_sag"))
    assert not steady.same(answer("supply_sag"), answer("supply_sag", "gyro_bias"))
    declared = answer("bridge_drop", sets=[("bridge_drop", "driver_deadzone")])
    assert steady.same(declared, answer("driver_deadzone", sets=[("bridge_drop", "driver_deadzone")]))
    assert not steady.same(declared, answer("driver_deadzone"))
    large = [("bridge_drop", "driver_deadzone", "supply_sag", "driver_gain")]
    assert not steady.same(answer("bridge_drop", sets=large), answer("driver_deadzone", sets=large))


def test_effects_that_hardly_matter_are_not_asked_of_the_other_half():
    """An effect counts where its absence leaves 1.5 times what is left with it."""
    assert steady.seen(answer("gyro_bias", left=1.0, without=1.6)) == {("gyro_bias", "both")}
    assert steady.seen(answer("gyro_bias", left=0.5, without=1.4)) == set()
    assert steady.seen(answer("gyro_bias", left=3.0, without=4.4)) == set()


def test_copies_differ_in_noise_or_in_runs_alone(case, tmp_path):
    louder = read_case(steady.scaled(case, tmp_path / "louder", 3.0))
    plain = builtin_robot("burger")
    assert louder.robot.noise("w_l") == pytest.approx(3 * plain.noise("w_l"), rel=1e-3)
    assert (louder.robot.motor, louder.robot.chassis) == (plain.motor, plain.chassis) and len(louder.runs) == 3
    names = [[run.name for run in read_case(steady.half(case, tmp_path / f"half{k}", k)).runs] for k in (0, 1)]
    assert names == [["a", "c"], ["b"]]


def test_cut_runs_lack_their_last_rows_and_nothing_else(case, tmp_path):
    shorter, whole = read_case(steady.cut(case, tmp_path / "shorter", 3)), read_case(case)
    assert shorter.robot == whole.robot and [run.name for run in shorter.runs] == ["a", "b", "c"]
    for less, run in zip(shorter.runs, whole.runs, strict=True):
        assert less.meta == run.meta and np.array_equal(less.t, run.t[:-3])
        assert less.columns.keys() == run.columns.keys()
        assert all(np.array_equal(values, run.columns[name][:-3]) for name, values in less.columns.items())


@pytest.mark.parametrize("rows", [-1, 0, 99, 1000])
def test_no_more_rows_are_cut_than_a_run_has(case, tmp_path, rows):
    with pytest.raises(InputError, match=f"a: has 100 rows, {rows} cannot be cut"):
        steady.cut(case, tmp_path / "none", rows)
    assert not (tmp_path / "none").exists()


def test_a_case_of_one_run_has_no_halves(case, tmp_path):
    with pytest.raises(InputError, match="halves need two"):
        steady.half(steady.half(case, tmp_path / "one", 1), tmp_path / "none", 0)


def test_the_tool_counts_and_goes_on_where_it_stopped(case, tmp_path, diagnoser, capsys):
    """A diagnoser that names a gain where the noise is large, and leaves less there than asks for the same names."""
    large = "load_robot(place / 'robot.toml').noise('w_l') > 0.05"
    script = diagnoser(f"{answer('gyro_gain')!r} if {large} else {answer('gyro_bias')!r}")
    steady.main([str(case), "--out", str(tmp_path / "out"), "--noise", "0.5", "--noise", "3"])
    text = capsys.readouterr().out
    assert "noise × 0.5: 1/1" in text and "noise × 3: 0/1" in text
    script.unlink()
    steady.main([str(case), "--out", str(tmp_path / "out"), "--noise", "3"])
    assert "noise × 3: 0/1" in capsys.readouterr().out
    kept = json.loads((tmp_path / "out" / "case" / "noise-3" / "diagnosis.json").read_text())
    assert kept["effects"][0]["id"] == "gyro_gain"


def test_names_of_either_answer_are_asked_of_the_other_where_runs_lack_rows(case, tmp_path, diagnoser, capsys):
    """A diagnoser that names a second gain where a run is short: of the three names that count two are in the other."""
    short = "len(read_case(place).runs[0].t) < 98"
    diagnoser(f"{answer('gyro_bias', 'gyro_gain')!r} if {short} else {answer('gyro_bias')!r}")
    steady.main([str(case), "--out", str(tmp_path / "out"), "--cut", "1", "--cut", "3"])
    text = capsys.readouterr().out
    assert "1 rows less" in text and "2/2" in text and "2/3" in text and "names with rows less: 4/5" in text


@pytest.fixture
def halves(case, tmp_path, diagnoser, monkeypatch, capsys):
    """The last line of the tool where the half with run b names nothing, and some gaps are its with and without the
    gain that the other half names.
    """

    def last_line(gaps):
        diagnoser(f"{answer()!r} if (place / 'b').is_dir() else {answer('gyro_gain')!r}")
        shower = tmp_path / "shower.py"
        shower.write_text(f"import json\nprint(json.dumps({{'gyro_gain both': {gaps!r}}}))\n")
        monkeypatch.setattr(steady, "SHOWER", [sys.executable, str(shower)])
        steady.main([str(case), "--out", str(tmp_path / "out"), "--halves"])
        return capsys.readouterr().out.splitlines()[-1]

    return last_line


def test_a_name_is_asked_of_the_other_half_where_its_runs_show_the_effect(halves):
    assert halves([2.0, 4.0]).startswith("names of halves: 0/1")


def test_a_name_is_not_asked_of_the_other_half_where_its_runs_hardly_show_it(halves):
    assert halves([2.0, 2.5]).startswith("names of halves: 0/0")


def test_a_tool_that_fails_is_no_half_that_shows_nothing(tmp_path):
    """Status 2 says that the machine cannot have the effects; any other failure is none of the case's."""
    for status, name in ((2, "refused"), (3, "broken")):
        script = tmp_path / f"{name}.py"
        script.write_text(f"import sys\nsys.exit({status})\n")
        out = tmp_path / name
        out.mkdir()
        if status == 2:
            assert steady.shown(tmp_path, out, [sys.executable, str(script)]) == set()
        else:
            with pytest.raises(InputError, match="status 3"):
                steady.shown(tmp_path, out, [sys.executable, str(script)])
