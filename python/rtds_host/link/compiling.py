"""Compiles what Verilator has written, without its makefile: `verilator --make json`, then the compiler, file by file.

Verilator's makefile needs a program named `python`, which Debian does not have, and GNU make refuses folders with a
space in their path. The list of files and options in Verilator's JSON says all that is needed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rtds_host.cleanup import supervisor
from rtds_host.errors import LinkError

COMPILER = "g++"
_POLL_S = 0.02

# What a line holds that says why a compiler or a linker gave up, best first.
_REASONS = (
    "error:",
    "%error",
    "undefined reference",
    "cannot find",
    "multiple definition",
    "not found",
    "cannot be started",
    "error",
)


def first_error(log: str) -> str:
    """The line of a build's log that says what was wrong: the first real error, else the last line."""
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    for reason in _REASONS:
        for line in lines:
            # The linker's summary says only that there was an error.
            if reason in line.lower() and not line.startswith("collect2:"):
                return line
    return lines[-1] if lines else "no output"


def run(
    what: str,
    commands: Sequence[Sequence[str]],
    log: Path,
    timeout_s: float,
    environment: Mapping[str, str] | None = None,
) -> None:
    """Run build commands, as many at once as there are processors, with their output in `log`.

    Raises
    ------
    LinkError : one of them failed, was killed, cannot be started, or all took longer than `timeout_s`; the message
    quotes
        the compiler's own line.
    """
    deadline = time.monotonic() + timeout_s
    before, descriptor = supervisor()  # should this process be killed, no compiler works on
    waiting = list(commands)
    running: list[subprocess.Popen] = []
    failed: int | None = None
    with open(log, "ab") as stream:
        try:
            while (waiting and failed is None) or running:
                while waiting and failed is None and len(running) < (os.cpu_count() or 1):
                    try:
                        running.append(subprocess.Popen(
                            [*before, *waiting.pop(0)], stdin=subprocess.DEVNULL, stdout=stream, stderr=stream,
                            env={**os.environ, **(environment or {})}, pass_fds=(descriptor,), start_new_session=True,
                        ))  # fmt: skip
                    except OSError as error:
                        raise LinkError(f"{what} failed: {error.filename}: {error.strerror}") from error
                for process in [p for p in running if p.poll() is not None]:
                    running.remove(process)
                    failed = failed or process.returncode or None
                if time.monotonic() > deadline:
                    raise LinkError(f"{what} took more than {timeout_s:g} s, given up")
                if running:
                    time.sleep(_POLL_S)
        finally:  # a timeout, or Ctrl-C: take the compilers with it
            for process in running:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
    if failed is not None:
        how = f"killed by {signal.Signals(-failed).name}" if failed < 0 else f"exit status {failed}"
        raise LinkError(f"{what} failed ({how}): {first_error(log.read_text(errors='replace'))[:300]}")


@dataclass(frozen=True)
class Compilation:
    """The commands that make a program of what Verilator has written: the objects' (in any order), then the
    linker's.
    """

    objects: tuple[tuple[str, ...], ...]
    link: tuple[str, ...]


def compilation(
    plan: Path, program: Path, optimise: str, defines: Sequence[str] = (), libraries: Sequence[str] = ()
) -> Compilation:
    """The commands for `plan`, the JSON file of `verilator --make json`.

    Parameters
    ----------
    plan : `<folder>/<prefix>.json`; objects are made next to it.
    program : the program to make.
    optimise : optimisation of the model and of the sources given to Verilator ("-O3", or several options
        with blanks between); its run-time library gets -Os.
    defines : more arguments for compiling, such as "-DNAME=value".
    libraries : more arguments for linking.

    Raises
    ------
    LinkError : the plan cannot be read.
    """
    folder = plan.parent
    try:
        said = json.loads(plan.read_text())
        sources, options, root = said["sources"], said["options"], Path(said["system"]["verilator_root"])
        lists = ("classes_fast", "support_fast", "classes_slow", "support_slow")  # empty ones are left out
        model = [name for kind in lists for name in sources.get(kind, [])]
        users, library = sources["user_classes"], sources["global"]
    except (OSError, ValueError, KeyError) as error:
        raise LinkError(
            f"{plan}: Verilator's list of what to compile is not usable ({error}); it needs 5.036"
        ) from error
    # One C++ file for the whole model: the compiler sees all of it, and small designs compile faster.
    whole = folder / f"{plan.stem}__ALL.cpp"
    text = "#define VL_INCLUDE_OPT include\n" + "".join(f'#include "{name}"\n' for name in model)
    if not whole.is_file() or whole.read_text() != text:
        whole.write_text(text)
    kinds = {"COVERAGE": "coverage", "SC": "system_c", "TIMING": "use_timing", "TRACE": "trace",
    "TRACE_FST": "trace_fst",
             "TRACE_VCD": "trace_vcd", "TRACE_SAIF": "trace_saif"}  # fmt: skip
    common = [
        f"-I{folder}", f"-I{root / 'include'}", f"-I{root / 'include' / 'vltstd'}", "-DVERILATOR=1",
        *(f"-DVM_{name}={int(options[key])}" for name, key in kinds.items()), *defines,
        *(["-fcoroutines"] if options["use_timing"] else []),
    ]  # fmt: skip
    files = [(str(whole), optimise), *((name, optimise) for name in users), *((name, "-Os") for name in library)]
    objects = [folder / f"{number}-{Path(name).stem}.o" for number, (name, _) in enumerate(files)]
    return Compilation(
        tuple(
            (COMPILER, *option.split(), *common, "-MMD", "-c", "-o", str(target), name)
            for (name, option), target in zip(files, objects, strict=True)
        ),
        (COMPILER, "-o", str(program), *map(str, objects), "-pthread", *libraries),
    )


def _up_to_date(target: Path, command: Sequence[str]) -> bool:
    """Whether `target` was made by this very command after the last change of every file it is made of."""
    said, list_of_files = Path(f"{target}.command"), target.with_suffix(".d")
    try:
        if said.read_text() != "\n".join(command):
            return False
        # "target: file file\\<end of line> file", a space inside of a name with a backslash before it.
        names = re.split(r"(?<!\\)\s+", list_of_files.read_text().split(":", 1)[1].replace("\\\n", "").strip())
        made = target.stat().st_mtime_ns
        return all(Path(name.replace("\\ ", " ")).stat().st_mtime_ns < made for name in names)
    except (OSError, IndexError):
        return False


def compile_all(
    plan: Path,
    program: Path,
    optimise: str,
    defines: Sequence[str],
    libraries: Sequence[str],
    log: Path,
    timeout_s: float,
) -> None:
    """Compile and link what is not up to date (for the parameters see `compilation`).

    Raises
    ------
    LinkError : as `run` and `compilation`.
    """
    todo = compilation(plan, program, optimise, defines, libraries)
    stale = {_target(command): command for command in todo.objects if not _up_to_date(_target(command), command)}
    linked = Path(f"{program}.command")
    if not stale and program.is_file() and linked.is_file() and linked.read_text() == "\n".join(todo.link):
        return
    for target in (*stale, program):
        Path(f"{target}.command").unlink(missing_ok=True)
    run("compiling the simulator", list(stale.values()), log, timeout_s)
    for target, command in stale.items():
        Path(f"{target}.command").write_text("\n".join(command))
    run("linking the simulator", [todo.link], log, timeout_s)
    linked.write_text("\n".join(todo.link))


def _target(command: Sequence[str]) -> Path:
    return Path(command[command.index("-o") + 1])
