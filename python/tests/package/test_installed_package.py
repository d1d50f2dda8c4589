"""The wheel, away from the checkout: what it holds, and that import, diagnosis, prediction, driving and the notebook
work.
"""

import inspect
import json
import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

import rtds_host
import rtds_host.api

ROOT = Path(__file__).resolve().parents[3]
NOTEBOOK = ROOT / "examples" / "from_a_log_to_a_simulator.ipynb"
FUNCTIONS = ("close", "diagnose", "predict", "read_case", "run")


@pytest.fixture(scope="session")
def installed(wheel, tmp_path_factory):
    """Run Python with the wheel's package in the place of the checkout's, in a folder with nothing but the examples'
    files.
    """
    folder = tmp_path_factory.mktemp("away")
    site = folder / "site"
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(site)
    (folder / "work").mkdir()
    for name in ("rover.csv", "rover.toml", "truth.json"):
        (folder / "work" / name).write_bytes((ROOT / "examples" / name).read_bytes())

    def python(*arguments):
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(site), sysconfig.get_paths()["purelib"]]),
            "XDG_CACHE_HOME": str(folder / "cache"),
            "NO_COLOR": "1",
            "MPLBACKEND": "agg",
        }
        # -S: without the editable installation of the checkout, which a .pth file of the environment brings.
        command = [sys.executable, "-S", *map(str, arguments)]
        done = subprocess.run(
            command, cwd=folder / "work", env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    python.folder = folder
    return python


def test_the_wheel_holds_the_verilog_what_builds_it_the_types_and_the_licence(wheel):
    with zipfile.ZipFile(wheel) as packed:
        names = set(packed.namelist())
    for folder in ("rtl", "sim"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".v", ".vh", ".f", ".vlt", ".cpp"):
                assert f"rtds_host/hardware/{path.relative_to(ROOT)}" in names
    for path in (ROOT / "python" / "rtds_host" / "native" / "c").iterdir():
        assert f"rtds_host/native/c/{path.name}" in names
    assert {"rtds_host/py.typed", "rtds_host/hardware/sim/bridge.py", "rtds_host/contract/robots/burger.toml"} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not any("tests" in name or name.endswith(".pyc") for name in names)


def test_an_installed_package_builds_and_drives_the_verilog(installed):
    out = installed(
        "-m",
        "rtds_host.cli.main",
        "run",
        "linear",
        "--length",
        "0.1",
        "--duration",
        "1",
        "--set",
        "ramp_s=0.3",
        "--set",
        "stop_s=0.3",
        "--no-compare",
        "--no-figure",
        "--out",
        "drive",
    )
    assert installed("-c", "import rtds_host; print(rtds_host.__file__)").startswith(str(installed.folder / "site"))
    assert "rtl (verilator" in out
    assert (installed.folder / "work" / "drive" / "log.csv").is_file()
    assert [path for path in (installed.folder / "cache" / "rtds" / "sim").iterdir() if path.is_dir()]


def test_an_installed_package_writes_an_fmu_that_fmpy_runs(installed):
    installed("-m", "rtds_host.cli.main", "export", "burger", "--to", "fmu-motors", "--out", "motors.fmu")
    path = installed.folder / "work" / "motors.fmu"
    assert validate_fmu(str(path)) == []
    result = fmpy.simulate_fmu(str(path), start_values={"v_l": 6.0}, stop_time=0.05, output_interval=1e-3)
    assert result["w_l"][-1] > 100.0 and result["w_r"][-1] == 0.0


def notebook_script(folder):
    """The notebook's cells and what must hold after them, as a program; the path of the program."""
    cells = [
        "".join(cell["source"]) for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"
    ]
    check = """
assert closed.content["gap"]["simulator"]["closed"] > 0.95
print("as it should be")
"""
    path = folder / "notebook.py"
    path.write_text("\n\n".join([*cells, check]))
    return path


@pytest.mark.long  # dependencies are fetched, and all of numba is compiled again
def test_the_notebook_runs_from_an_installed_wheel(fresh, tmp_path):
    for name in ("rover.csv", "rover.toml", "truth.json"):
        (tmp_path / name).write_bytes((ROOT / "examples" / name).read_bytes())
    out = fresh.run("python", notebook_script(tmp_path), cwd=tmp_path)
    assert out.rstrip().endswith("as it should be")


def test_importing_the_package_loads_nothing_heavy():
    command = (
        "import sys, rtds_host; print([m for m in ('numpy', 'numba', 'scipy', 'pybullet', 'mujoco') if m in"
        " sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_function_is_documented_and_typed(name):
    function = getattr(rtds_host.api, name)
    assert name in rtds_host.__all__ and name in dir(rtds_host)
    for part in ("Returns\n", "Raises\n"):
        assert part in function.__doc__
    signature = inspect.signature(function)
    assert signature.return_annotation is not inspect.Signature.empty
    for parameter in signature.parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty
        assert parameter.name in function.__doc__ or parameter.name == "folder"


def test_run_is_a_function_whatever_was_imported_before(tmp_path):
    import rtds_host.run.plan  # gives the package an attribute `run`: the sub-package

    outcome = rtds_host.run(
        "linear",
        link="model",
        values={"duration_s": 0.5, "length_m": 0.02, "ramp_s": 0.1, "stop_s": 0.1},
        out=tmp_path / "drive",
        figure=False,
    )
    assert outcome.record.speeds.shape == (501, 2)
    assert (tmp_path / "drive" / "log.csv").is_file()


def test_a_place_that_cannot_be_written_is_named_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(rtds_host.OutputError, match="file"):
        rtds_host.run("linear", link="model", out=tmp_path / "file" / "drive")
    with pytest.raises(rtds_host.InputError, match="nowhere"):
        rtds_host.read_case(tmp_path / "nowhere")


def test_what_is_not_there_is_named():
    with pytest.raises(AttributeError, match="module 'rtds_host' has no attribute 'diagnos'"):
        rtds_host.diagnos  # noqa: B018
