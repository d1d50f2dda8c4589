"""What scripts and notebooks need: answers as JSON, and the commands as functions of the package."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pandas
import pytest

import rtds_host
from rtds_host.cli.commands import main
from rtds_host.contract import builtin_robot, builtin_robot_path
from rtds_host.diagnosis.effects import CATALOGUE

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.fixture
def printed(monkeypatch, capfd):
    """What a command prints, read as JSON."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rtds", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        assert ended.value.code == 0, err
        return json.loads(out)

    return call


def test_a_run_is_summed_up_as_json(printed, tmp_path):
    options = ("--link", "model", "--no-compare", "--no-figure", "--duration", "0.5", "--json")
    (one,) = printed("run", "crawl", *options, "--out", tmp_path / "o")["runs"]
    assert one["folder"] == str(tmp_path / "o")
    assert one["scenario"] == "crawl" and (tmp_path / "o" / "log.csv").is_file()


def test_an_import_is_said_as_json(printed, tmp_path):
    (one,) = printed("import", EXAMPLES / "square.mcap", "--out", tmp_path / "case", "--json")["runs"]
    assert one["rows"] > 10 and one["mode"] == "speed" and "mapping" in one["assumed"]


def test_the_catalogue_is_told_as_json(printed):
    assert {one["id"] for one in printed("effects", "--json")["effects"]} == set(CATALOGUE)
    (one,) = printed("effects", "backlash", "--json")["effects"]
    assert one["parameters"][0]["unit"] == "rad"


def test_several_cases_are_a_list_in_one_json_also_where_they_fail(monkeypatch, capfd, tmp_path):
    monkeypatch.setattr(
        sys, "argv", ["rtds", "diagnose", "a", "b", "--json", "--jobs", "1", "--out", str(tmp_path / "o")]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    found = json.loads(capfd.readouterr().out)["cases"]
    assert [(one["case"], one["verdict"]) for one in found] == [("a", None), ("b", None)]
    assert all("is not a case folder" in one["error"] for one in found)


def test_every_function_is_there_at_the_top():
    assert all(callable(getattr(rtds_host, name)) for name in ("import_case", "export", "plan", "diagnose", "run"))


def test_recordings_become_a_case_and_a_case_is_read(tmp_path):
    case = rtds_host.import_case([EXAMPLES / "square.mcap"], tmp_path / "case")
    assert len(case.runs) == 1 and (tmp_path / "case" / "robot.toml").is_file()


def test_a_plan_is_made_and_written(tmp_path):
    made = rtds_host.plan(builtin_robot("burger"), "steps", out=tmp_path / "plan")
    assert made.commands.values.shape == (len(made.commands.t), 2)
    assert (tmp_path / "plan" / "commands.csv").is_file()


def test_a_run_is_a_table_for_pandas_or_says_how_to_get_it(monkeypatch):
    outcome = rtds_host.run("crawl", link="model", values={"duration_s": 0.5}, figure=False)
    table = outcome.to_pandas()
    assert isinstance(table, pandas.DataFrame) and table.index.name == "t" and {"w_l", "i_r"} <= set(table.columns)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(rtds_host.InputError, match="pip install pandas"):
        outcome.to_pandas()


def test_the_robot_of_a_diagnosis_is_exported_by_its_path(tmp_path):
    with pytest.raises(rtds_host.InputError, match="nowhere.json"):
        rtds_host.export(tmp_path / "nowhere.json", "mjcf", robot=builtin_robot_path("burger"))


def test_the_first_command_says_that_it_compiles_and_the_next_one_does_not(tmp_path, monkeypatch, capsys):
    from rtds_host.cli import first_use

    assert not first_use.is_compiled(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "kernel.replay-1.py311.nbi").touch()
    assert first_use.is_compiled(tmp_path) and not first_use.is_compiled(tmp_path / "x")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(first_use, "is_compiled", lambda *_: False)
    first_use.say_if_first()
    assert capsys.readouterr().err == first_use.SAID + "\n"


@pytest.mark.parametrize("name", ["distributed", "dask"])
def test_without_the_extra_a_cluster_is_refused_with_what_to_install(monkeypatch, name):
    from rtds_host import workers

    monkeypatch.setattr(workers, "check_reachable", lambda _: None)
    monkeypatch.setitem(sys.modules, name, None)
    with (
        pytest.raises(rtds_host.LinkError, match=r"pip install 'rtds-host\[cluster\]'"),
        workers.client_of("tcp://here:1"),
    ):
        pass


@pytest.mark.parametrize("asked", [None, "Zen"])
def test_linear_algebra_sums_alike_on_all_processors_with_avx2(asked):
    """Each kernel of OpenBLAS has other last digits, by which one explanation is chosen before another that is as good.
    Who asks for a kernel gets it."""
    processor = Path("/proc/cpuinfo").read_text().split()
    kernel = asked or ("Haswell" if {"avx2", "fma"} <= set(processor) else "None")
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    environment |= {"OPENBLAS_CORETYPE": asked} if asked else {}
    script = "import os, rtds_host\nprint(os.environ.get('OPENBLAS_CORETYPE'))"
    told = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == kernel
