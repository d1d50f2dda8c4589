"""Ctrl-C at any moment of the process `rtds`: one line and status 130, or the end that the command had already
come to.
"""

import os
import subprocess
import sys

import pytest

STRIKE = (
    "import os, signal, sys\nimport rtds_host.cli.main as command\nstrike = lambda: os.kill(os.getpid(),"
    " signal.SIGINT)\n"
)
INTERRUPTED = (130, "rtds: interrupted\n")


def struck(tmp_path, program, *arguments):
    """(status, standard error) of `rtds` with a signal that the program sends to its own process; what it printed."""
    (tmp_path / "struck.py").write_text(STRIKE + program + "command.main()\n")
    done = subprocess.run(
        [sys.executable, "-m", "struck", *arguments],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    # Click begins a new line behind the ^C that a terminal shows.
    return (done.returncode, done.stderr.lstrip("\n")), done.stdout


@pytest.mark.parametrize("module", ["click", "typer", "rtds_host.cli.commands", "rtds_host.cli.effects"])
def test_while_modules_load(tmp_path, module):
    program = f"""
class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == {module!r}:
            strike()
sys.meta_path.insert(0, Finder)
"""
    assert struck(tmp_path, program, "effects")[0] == INTERRUPTED


def test_while_an_import_executes_a_string(tmp_path):
    # Dataclasses and named tuples do so; Python remembers it, and would end by the signal in spite of another status.
    program = "from rtds_host.cli import commands\ncommands.root.main = lambda **_: exec('raise KeyboardInterrupt')\n"
    assert struck(tmp_path, program)[0] == INTERRUPTED


def test_while_an_error_is_said(tmp_path):
    program = """
from rtds_host.cli import commands
said = commands.visible
commands.visible = lambda text: (strike(), said(text))[1]
"""
    assert struck(tmp_path, program, "diagnose", "nowhere", "--out", "out")[0] == INTERRUPTED


LAST_MOMENTS = {
    "when Python begins to leave": "import atexit\natexit.register(strike)\n",
    "while threads are waited for": "import threading, time\n"
    "threading.Thread(target=lambda: (threading.main_thread().join(), strike())).start()\n",
    # Python has given up its own handling of signals by then.
    "while modules are taken down": """
class Last:
    def __del__(self, kill=os.kill, me=os.getpid(), signal=signal.SIGINT):
        kill(me, signal)
sys.last_of_all = Last()
""",
}


@pytest.mark.parametrize("program", LAST_MOMENTS.values(), ids=LAST_MOMENTS.keys())
@pytest.mark.parametrize(("arguments", "status"), [(("--version",), 0), (("diagnose", "nowhere", "--out", "out"), 2)])
def test_when_the_work_is_done_nothing_changes_its_end(tmp_path, program, arguments, status):
    ended, printed = struck(tmp_path, program, *arguments)
    assert ended == (status, "rtds: nowhere: is not a case folder\n" if status else "")
    assert printed.startswith("rtds, version") == (status == 0)


def test_before_it_waits_for_ctrl_c_the_program_loads_nothing_but_itself(tmp_path):
    program = (
        "import sys\nbefore = set(sys.modules)\nimport rtds_host.cli.main\nprint(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert set(done.stdout.split()) <= {"__future__", "rtds_host", "rtds_host.cli", "rtds_host.cli.main"}
