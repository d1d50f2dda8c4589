"""Several recordings of one robot, appending to a case, and the command itself."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from import_recordings import turtlebot

from rtds_host.cli.commands import main
from rtds_host.contract import RunMeta, builtin_robot_path, read_case
from rtds_host.errors import InputError
from rtds_host.importers import import_case


@pytest.fixture
def bags(tmp_path):
    for name in ("one", "two", "three"):
        turtlebot(3.0).mcap(tmp_path / f"{name}.mcap")
    return tmp_path


def rtds(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["rtds", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    said = capsys.readouterr()
    return end.value.code, said.out, said.err


def test_several_bags_are_runs_of_one_case_and_more_can_follow(bags, monkeypatch, capsys):
    case = bags / "case"
    code, out, err = rtds(
        monkeypatch, capsys, "import", bags / "one.mcap", bags / "two.mcap", "--out", case, "--payload-kg", 0.5
    )
    assert (code, err) == (0, "")
    assert "speed mode" in out and "w_l 60" in out
    code, _, err = rtds(
        monkeypatch,
        capsys,
        "import",
        bags / "three.mcap",
        "--out",
        case,
        "--append",
        "--name",
        "hill",
        "--slope-rad",
        0.1,
        "--scenario",
        "ramp",
    )
    assert (code, err) == (0, "")
    runs = {run.name: run for run in read_case(case).runs}
    assert sorted(runs) == ["hill", "one", "two"]
    assert runs["one"].meta.payload_kg == 0.5 and runs["hill"].meta.slope_rad == 0.1
    assert runs["hill"].meta.scenario == "ramp" and runs["one"].meta.scenario == "one"
    assert sorted(p.name for p in bags.iterdir() if p.name.startswith(".")) == []


def test_a_case_is_never_overwritten_by_accident(bags, monkeypatch, capsys):
    case = bags / "case"
    import_case([bags / "one.mcap"], case)
    before = (case / "one" / "log.csv").read_bytes()
    for arguments, complaint in (
        (("import", bags / "two.mcap", "--out", case), "exists already; --append adds runs"),
        (("import", bags / "one.mcap", "--out", case, "--append"), "the case has this run already"),
        (("import", bags / "two.mcap", bags / "two.mcap", "--out", case, "--append"), "two recordings"),
        (("import", bags / "two.mcap", "--out", bags / "none", "--append"), "no case to append to"),
        (("import", bags / "two.mcap", "--out", case, "--append", "--name", "../up"), "letters, digits"),
        (("import", bags / "two.mcap", "--out", case, "--append", "--name", "a", "--name", "b"), "2 names"),
        (("import", bags / "two.mcap", "--out", case, "--append", "--slope-rad", "5"), "slope_rad is 5"),
        (("import", bags / "two.mcap", "--out", case, "--append", "--robot", "paper"), "differs .* in motor"),
        (("import", bags / "two.mcap", "--out", bags / "new", "--robot", "crane"), "known: burger, paper"),
        (("import", bags / "two.mcap"), "--out CASE: missing"),
        (("import", bags / "four.mcap", "--out", case, "--append"), "four.mcap: does not exist"),
        (
            ("import", bags / "two.mcap", "--out", case, "--append", "--mapping", "lunar"),
            "known: create3, jackal, rtds, turtlebot3",
        ),
    ):
        code, _, err = rtds(monkeypatch, capsys, *arguments)
        assert code == 2
        assert err.count("\n") == 1 and err.startswith("rtds: ")
        import re

        assert re.search(complaint, err), err
    assert (case / "one" / "log.csv").read_bytes() == before
    assert sorted(p.name for p in case.iterdir()) == ["one", "robot.toml"]
    assert not (bags / "new").exists()


def test_one_bad_recording_leaves_nothing_behind(bags):
    (bags / "bad.mcap").write_bytes((bags / "one.mcap").read_bytes()[:4000])
    with pytest.raises(InputError, match="bad.mcap: is truncated"):
        import_case([bags / "one.mcap", bags / "bad.mcap"], bags / "case")
    assert not (bags / "case").exists()


def test_voltage_and_speed_commands_do_not_mix_in_a_case(bags):
    import_case([bags / "one.mcap"], bags / "case")
    table = bags / "log.csv"
    table.write_text("t,v,w\n" + "".join(f"{0.02 * k},1.0,0.5\n" for k in range(20)))
    mapping = bags / "map.toml"
    mapping.write_text(
        'schema = "rtds-mapping/1"\n[time]\ncolumn = "t"\n[signal]\nv_cmd_l = { column = "v" }\n'
        'v_cmd_r = { column = "v" }\nw_l = { column = "w" }\n'
    )
    with pytest.raises(InputError, match="the case holds speed commands, the recording holds voltage commands"):
        import_case([table], bags / "case", mapping=mapping, append=True)
    with pytest.raises(InputError, match="no nominal robot"):
        import_case([table], bags / "other", mapping=mapping)


def test_the_mapping_may_say_what_was_special_about_a_run(bags):
    mapping = bags / "map.toml"
    mapping.write_text('schema = "rtds-mapping/1"\nbase = "turtlebot3"\n[runs.two]\npayload_kg = 1.5\nnotes = "box"\n')
    import_case([bags / "one.mcap", bags / "two.mcap"], bags / "case", mapping=mapping, meta=RunMeta("", 0.2))
    runs = {run.name: run.meta for run in read_case(bags / "case").runs}
    assert (runs["one"].payload_kg, runs["two"].payload_kg, runs["two"].notes) == (0.2, 1.5, "box")


def test_the_nominal_robots_own_words_are_kept(bags):
    robot = bags / "mine.toml"
    text = builtin_robot_path("burger").read_text().replace("burger-nominal", "lab-3")
    text = text.replace("[sensors]", '[driver]   # old\nmode = "voltage"\nbus = "measured"\n\n[sensors]')
    robot.write_text(text)
    import_case([bags / "one.mcap"], bags / "case", robot=str(robot))
    written = (bags / "case" / "robot.toml").read_text()
    assert "# everything but payload, wheels included" in written and written.count("[driver]") == 1
    case = read_case(bags / "case")
    assert (case.robot.name, case.robot.driver.mode, case.robot.driver.bus) == ("lab-3", "speed", "measured")


def test_parquet_holds_the_same_run(bags):
    import_case([bags / "one.mcap"], bags / "csv")
    import_case([bags / "one.mcap"], bags / "parquet", form="parquet")
    assert (bags / "parquet" / "one" / "log.parquet").is_file()
    a, b = read_case(bags / "csv").runs[0], read_case(bags / "parquet").runs[0]
    assert np.allclose(a.t, b.t, atol=1e-6)
    for name in a.columns:
        assert np.allclose(a.columns[name], b.columns[name], rtol=1e-7, equal_nan=True)


def test_topics_can_be_listed(bags, monkeypatch, capsys):
    code, out, _ = rtds(monkeypatch, capsys, "import", "--list", bags / "one.mcap")
    assert code == 0
    assert "/joint_states  sensor_msgs/msg/JointState  60 messages" in out
