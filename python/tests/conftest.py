"""Settings of all host tests, and the package as a wheel and installed."""

import importlib.metadata
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import rtds_host  # noqa: F401  before numpy: it sets the threads of a BLAS call

ROOT = Path(__file__).resolve().parents[2]

# A test run that a shell put into the background ignores Ctrl-C, and so would the programs whose Ctrl-C is tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# What keeps the documentation's pages and recordings lies with them.
sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))


@pytest.fixture(scope="session")
def wheel(tmp_path_factory):
    """The wheel of this checkout, built from what git would hand on."""
    if int(importlib.metadata.version("setuptools").split(".")[0]) < 77:
        pytest.fail("the wheel needs setuptools 77, which `make setup` installs")
    folder = tmp_path_factory.mktemp("wheel")
    tree = folder / "tree"
    files = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    for name in filter(None, files):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            (tree / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, tree]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("*.whl")
    return path


class Installed:
    """An environment away from the checkout that holds the wheel and what it declares to need, and nothing else."""

    def __init__(self, prefix, cache):
        self.prefix = prefix
        self.environment = {
            name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))
        }
        self.environment |= {
            "PATH": f"{prefix}/bin:{os.environ['PATH']}",
            "XDG_CACHE_HOME": str(cache),
            "NO_COLOR": "1",
            "MPLBACKEND": "agg",
        }

    def run(self, *command, cwd):
        """Run a program of the environment; its output. A program that fails fails the test."""
        done = subprocess.run(
            [f"{self.prefix}/bin/{command[0]}", *map(str, command[1:])],
            cwd=cwd,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


@pytest.fixture(scope="session")
def fresh(wheel, tmp_path_factory):
    """The wheel installed into an environment of its own, with its dependencies from the package index: minutes."""
    folder = tmp_path_factory.mktemp("fresh")
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
    installed = Installed(folder / "venv", folder / "cache")
    installed.run("python", "-m", "pip", "install", "-q", "--disable-pip-version-check", wheel, cwd=folder)
    installed.run("python", "-m", "pip", "check", "--disable-pip-version-check", cwd=folder)
    place = installed.run("python", "-c", "import rtds_host; print(rtds_host.__file__)", cwd=folder)
    assert place.startswith(str(folder / "venv"))
    return installed


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A headless Chromium; what needs it is marked `browser`."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--no-first-run",
        "--disable-dev-shm-usage",
        "--window-size=1200,1400",
        f"--user-data-dir={tmp_path_factory.mktemp('profile')}",
    ):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()
