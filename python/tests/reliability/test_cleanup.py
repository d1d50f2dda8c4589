"""What a killed process leaves: no other process, and scratch only until the next start."""

import ast
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from rtds_host.cleanup import end_running, run_supervised, temporary_folder
from rtds_host.contract import staged_folder, write_atomic
from rtds_host.workers import on_threads

WRITES = """
import sys, time
from pathlib import Path
from rtds_host.contract import staged_folder
from rtds_host.cleanup import new_file, temporary_folder
with temporary_folder(), staged_folder({target!r}) as scratch:
    (scratch / "half").write_text("half")
    kept = new_file({place!r}, "table.csv")
    print("there", flush=True)
    time.sleep(60)
"""
STARTS = """
import sys
from rtds_host.cleanup import run_supervised
child = "import subprocess, sys, time; " \\
        "p = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']); " \\
        "open(sys.argv[1], 'w').write(str(p.pid)); time.sleep(60)"
run_supervised([sys.executable, "-c", child, sys.argv[1]])
"""


def lives(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def until(condition) -> None:
    """Wait for something that must come; a test that waits in vain fails instead of hanging."""
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("what must come did not")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder of the system's temporary files for this test alone."""
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setenv("TMPDIR", str(place))
    monkeypatch.setattr("tempfile.tempdir", None)
    return place


def killed(tmp_path: Path) -> None:
    program = WRITES.format(target=str(tmp_path / "out"), place=str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout.readline() == "there\n"
        writer.kill()


def hidden(place: Path) -> list[str]:
    return sorted(p.name for p in place.iterdir() if p.name.startswith("."))


def test_what_a_killed_process_was_writing_goes_with_the_next_start(tmp_path, temporary):
    killed(tmp_path)
    assert len(hidden(tmp_path)) == 2 and len(list(temporary.iterdir())) == 1
    with staged_folder(tmp_path / "out") as scratch:
        (scratch / "whole").write_text("whole")
    write_atomic(tmp_path / "table.csv", "t\n")
    with temporary_folder():
        pass
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "table.csv", "temporary"]
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["whole"] and list(temporary.iterdir()) == []


def test_what_is_in_use_or_not_ours_is_left_alone(tmp_path, temporary):
    (tmp_path / ".out-20240101").mkdir()
    (tmp_path / ".other-abcd1234.rtds").mkdir()
    with staged_folder(tmp_path / "out") as first, temporary_folder() as kept:
        with staged_folder(tmp_path / "out") as second, temporary_folder():
            (second / "b").write_text("b")
        assert first.is_dir() and kept.is_dir()
        (first / "a").write_text("a")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a", "b"]
    assert hidden(tmp_path) == [".other-abcd1234.rtds", ".out-20240101"]


def test_a_program_and_what_it_started_end_with_the_killed_process(tmp_path):
    note = tmp_path / "pid"
    parent = subprocess.Popen([sys.executable, "-c", STARTS, str(note)])
    until(lambda: note.exists() and note.read_text())
    grandchild = int(note.read_text())
    assert lives(grandchild)
    parent.kill()
    parent.wait()
    until(lambda: not lives(grandchild))


def test_a_program_that_takes_too_long_is_ended():
    with pytest.raises(subprocess.TimeoutExpired):
        run_supervised([sys.executable, "-c", "import time; time.sleep(600)"], timeout_s=0.2)


@pytest.mark.parametrize(
    ("program", "status"),
    [
        ("import sys; sys.exit(7)", 7),
        ("pass", 0),
        ("import os; os.kill(os.getpid(), 15)", -signal.SIGTERM),
        ("import os; os.kill(os.getpid(), 9)", -signal.SIGKILL),
    ],
)
def test_a_guarded_program_ends_as_it_would_alone(program, status):
    done = run_supervised(
        [
            sys.executable,
            "-c",
            f"import sys; print('out'); print('err', file=sys.stderr); sys.stdout.flush(); {program}",
        ]
    )
    assert (done.returncode, done.stdout, done.stderr) == (status, "out\n", "err\n")


def test_a_program_that_is_not_there_is_said():
    done = run_supervised(["/no/such/program"])
    assert done.returncode == 127 and "/no/such/program: cannot be started" in done.stderr


def wait_long(note: str) -> int:
    return run_supervised(
        [sys.executable, "-c", f"import os, time; open({note!r}, 'w').write(str(os.getpid())); time.sleep(60)"]
    ).returncode


def test_programs_end_when_their_results_are_wanted_no_more(tmp_path):
    notes = [tmp_path / name for name in "ab"]
    outcomes = on_threads(
        wait_long,
        {n.name: (lambda n=n: (str(n),)) for n in notes} | {"c": lambda: (_ for _ in ()).throw(OSError(2, "no"))},
        3,
    )
    assert next(outcomes).name == "c"
    until(lambda: all(n.exists() and n.read_text() for n in notes))
    outcomes.close()
    # A killed process is gone when its parent has taken note of it.
    until(lambda: not any(lives(int(n.read_text())) for n in notes))
    end_running()


def test_a_pool_ends_though_a_process_of_it_was_ended_in_the_middle_of_its_result(tmp_path):
    """What is left in the pipe then is the length of a message and a part of it."""
    script = tmp_path / "halved.py"
    script.write_text("""
import os, struct
from contextlib import suppress
from rtds_host.workers import process_pool

if __name__ == "__main__":
    with suppress(KeyError), process_pool(1) as pool:
        pool.submit(int).result()
        os.write(pool._result_queue._writer.fileno(), struct.pack("!i", 100) + b"half")
        raise KeyError
    print("ended")
""")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout == "ended\n"


def test_no_descriptor_of_the_lifeline_reaches_another_program():
    """Else its end would never come while that program lives."""
    run_supervised([sys.executable, "-c", "pass"])
    shown = run_supervised([sys.executable, "-c", "import os; print(sorted(os.listdir('/proc/self/fd')))"])
    assert len(ast.literal_eval(shown.stdout)) <= 4


def test_a_folder_that_another_sweep_took_at_once_is_made_again(temporary, monkeypatch):
    """Between its making and its lock a folder looks like a dead process's: whoever sweeps just then removes it."""
    made, make = [], tempfile.mkdtemp

    def taken_once(*arguments, **options):
        made.append(make(*arguments, **options))
        if len(made) == 1:
            Path(made[0]).rmdir()
        return made[-1]

    monkeypatch.setattr("tempfile.mkdtemp", taken_once)
    with temporary_folder() as folder:
        assert folder == Path(made[1]) and folder.is_dir()
    assert list(temporary.iterdir()) == []
