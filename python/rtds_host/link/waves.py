"""Waveforms of the RTL: which signals, from when to when, how large a file, and views of it for two viewers.

The simulator writes the file (`sim/verilator_main.cpp`, class Waves). This module chooses the signals by name, says
what is asked for in the simulator's environment, and puts the finished file in its place with its views.
"""

from __future__ import annotations

import fnmatch
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rtds_host.errors import InputError, LinkError, OutputError, did_you_mean

TOP = "rtds_sim_top"
VIEW = f"{TOP}.u_view"
CLOCKED = (f"{TOP}.clk_i", f"{TOP}.period_q")  # signals that move in idle clocks, too

# Names for sets of patterns. A pattern is a full name, or has * for any characters, dots included.
_MOTORS = tuple(f"{VIEW}.{name}" for name in ("strobe", "valid", "ready", "step", "*_v", "*_nm", "*_a", "*_rad_s"))
PRESETS = {
    "motors": _MOTORS,
    "steps": (
        *_MOTORS,
        f"{TOP}.clk_i",
        f"{TOP}.u_core.u_sequencer.*",
        f"{TOP}.u_core.g_side[*].u_motor.*_i",
        f"{TOP}.u_core.g_side[*].u_motor.*_o",
    ),
    "core": (*_MOTORS, f"{TOP}.clk_i", f"{TOP}.u_core.*"),
    "all": (f"{TOP}.*",),
}
SUFFIX = ".fst"
DEFAULT_BYTES = 100_000_000
LEAST_BYTES = 10_000
_LAST_STEP = 2**32 - 1  # the core counts steps in 32 bits

_SCOPE = re.compile(r'VL_TRACE_PUSH_PREFIX\(tracep, "([^"]*)"')
_END = "VL_TRACE_POP_PREFIX("
_SIGNAL = re.compile(r'VL_TRACE_DECL_\w+\(tracep,[^"]*"([^"]+)"(.*)')
_RANGE = re.compile(r"::\w+, *(\d+), *(\d+)\);")


def declared(objects: Path) -> dict[str, str]:
    """The signals that the code which Verilator has written into a folder can trace: full name, and a bus's range.

    Parameters of modules and a second list of the top's ports are left out.

    Raises
    ------
    LinkError : there is no signal: another version of Verilator writes its code in another way.
    """
    found: dict[str, str] = {}
    for path in sorted(objects.glob("*Trace__*Slow.cpp")):
        scopes: list[str] = []
        for line in path.read_text().splitlines():
            if scope := _SCOPE.search(line):
                scopes.append(scope[1])
            elif _END in line:
                scopes.pop()
            elif (signal := _SIGNAL.search(line)) and scopes[:1] == [TOP] and "::PARAMETER" not in signal[2]:
                bits = _RANGE.search(signal[2])
                found[".".join([*scopes, signal[1]])] = f"[{bits[1]}:{bits[2]}]" if bits else ""
    if not found:
        raise LinkError("no signal to trace was found in what Verilator has written; version 5.48 is known to work")
    return found


def write_signals(path: Path, signals: Mapping[str, str]) -> None:
    """Keep `signals` (see `declared`) in a build's folder, a line each."""
    path.write_text("".join(f"{name} {bits}\n" for name, bits in signals.items()))


def read_signals(path: Path) -> dict[str, str]:
    """What `write_signals` wrote."""
    return {name: bits for name, _, bits in (line.partition(" ") for line in path.read_text().splitlines())}


@dataclass(frozen=True)
class Waves:
    """What is to be written.

    Attributes
    ----------
    path : the file, ending in .fst. Next to it come views: `.gtkw` for GTKWave and `.sucl` for Surfer.
    signals : names of `PRESETS`, or patterns: a signal's full name with * for any characters.
    start_s, end_s : window in the run's time, s; `end_s` None is the run's end.
    limit_bytes : size from which on nothing more is written (by at most a block of some thousand clocks more).

    Raises
    ------
    InputError : a path, window or size that cannot be; OutputError : no such folder.
    """

    path: Path
    signals: tuple[str, ...] = ("motors",)
    start_s: float = 0.0
    end_s: float | None = None
    limit_bytes: int = DEFAULT_BYTES

    def __post_init__(self) -> None:
        if self.path.suffix != SUFFIX:
            raise InputError(f"waves {self.path}: the file's name must end in {SUFFIX}")
        if not self.path.resolve().parent.is_dir():
            raise OutputError(f"waves {self.path}: there is no folder {self.path.resolve().parent}")
        if self.path.is_dir():
            raise OutputError(f"waves {self.path}: is a folder")
        if not 0 <= self.start_s < float("inf") or (self.end_s is not None and not self.start_s < self.end_s):
            raise InputError(f"waves: the window {self.start_s:g}:{self.end_s} s must begin at 0 or later and then end")
        if self.limit_bytes < LEAST_BYTES:
            raise InputError(f"waves: a limit of {self.limit_bytes} bytes is too small, at least {LEAST_BYTES}")

    def chosen(self, signals: Mapping[str, str]) -> dict[str, str]:
        """Those of all `signals` (see `declared`) that the patterns choose.

        Raises
        ------
        InputError : a pattern chooses none.
        """
        names = list(signals)
        found: dict[str, str] = {}
        for pattern in self.signals:
            for one in PRESETS.get(pattern, (pattern,)):
                matching = fnmatch.filter(names, one.replace("[", "[[]"))
                if not matching and pattern not in PRESETS:
                    near = did_you_mean(pattern, [*PRESETS, *names])
                    raise InputError(
                        f"--wave-signals {pattern}: no such signal (sets: {', '.join(PRESETS)}; or a name such as "
                        f"{TOP}.u_core.*){near}"
                    )
                found.update((name, signals[name]) for name in matching)
        return found


@dataclass
class Recording:
    """Waveforms while a simulator writes them: a scratch file next to the wanted one, which takes its place at the end.

    `say` is called with a line about what became of the file.
    """

    waves: Waves
    signals: dict[str, str]
    say: Callable[[str], None]
    step_s: float = 0.0
    _scratch: Path = field(init=False)

    def __post_init__(self) -> None:
        try:
            self._scratch = Path(tempfile.mkdtemp(prefix=f".{self.waves.path.name}.", dir=self.waves.path.parent))
        except OSError as error:
            raise OutputError(f"waves {self.waves.path}: cannot write there ({error.strerror})") from error
        (self._scratch / "signals").write_text("".join(f"{name}\n" for name in self.signals))

    def environment(self, step_s: float) -> dict[str, str]:
        """Variables for the simulator, once the length of a step, s, is known."""
        self.step_s = step_s
        end = self.waves.end_s
        until = _LAST_STEP if end is None else min(_LAST_STEP, round(end / step_s))
        return {
            "RTDS_WAVES_FILE": str(self._scratch / "waves"),
            "RTDS_WAVES_SIGNALS": str(self._scratch / "signals"),
            "RTDS_WAVES_FROM": str(min(_LAST_STEP, round(self.waves.start_s / step_s))),
            "RTDS_WAVES_UNTIL": str(until),
            "RTDS_WAVES_BYTES": str(self.waves.limit_bytes),
            "RTDS_WAVES_CLOCKS": str(int(any(name in CLOCKED for name in self.signals))),
        }

    def finish(self, said: str) -> None:
        """Put the file and its views in their places; `said` is the simulator's standard error.

        Raises
        ------
        OutputError : the file cannot be put there.
        """
        target, made = self.waves.path, self._scratch / "waves"
        full = re.search(r"^waves: full at step (\d+)$", said, re.MULTILINE)
        if "waves: written" not in said.splitlines() or not made.is_file():
            self.say(
                f"rtds: {target}: the run has no step in the window {self.waves.start_s:g} s on; nothing is written"
            )
            return
        try:
            made.replace(target)
            target.with_suffix(".gtkw").write_text(gtkwave_view(self.signals, target))
            target.with_suffix(".sucl").write_text(surfer_view(self.signals))
        except OSError as error:
            raise OutputError(f"waves {target}: cannot be written ({error.strerror})") from error
        if full:
            self.say(
                f"rtds: {target}: has reached {self.waves.limit_bytes / 1e6:g} MB and ends at "
                f"{int(full[1]) * self.step_s:.4g} s of the run (--wave-size, --wave-window)"
            )

    def close(self) -> None:
        """Remove the scratch folder."""
        shutil.rmtree(self._scratch, ignore_errors=True)


# GTKWave's flags of a trace: 0x20 right-justified, 0x02 hexadecimal, 0x08 binary, 0x8000 drawn in steps,
# 0x80000 over the file's whole range, 0x20000 an empty line that makes the trace above it higher, 0x200 a heading.
_GTKW_REAL, _GTKW_BIT, _GTKW_WORD, _GTKW_HIGHER, _GTKW_HEADING = "@88020", "@28", "@22", "@20000", "@200"
_GTKW_HEIGHT = 3


def _groups(names: Sequence[str]) -> dict[str, list[str]]:
    """Names by the module they are in; the numbers of the motor units first."""
    groups: dict[str, list[str]] = {VIEW: []}
    for name in names:
        groups.setdefault(name.rsplit(".", 1)[0], []).append(name)
    return {scope: members for scope, members in groups.items() if members}


def _is_real(name: str) -> bool:
    return name.startswith(f"{VIEW}.") and name.endswith(("_v", "_nm", "_a", "_rad_s"))


def gtkwave_view(signals: Mapping[str, str], path: Path) -> str:
    """A save file of GTKWave: the numbers as curves, then the other signals by module."""
    lines = [f'[dumpfile] "{path.resolve()}"', f'[savefile] "{path.resolve().with_suffix(".gtkw")}"', "[timestart] 0"]
    for scope, members in _groups(list(signals)).items():
        lines += [_GTKW_HEADING, f"-{scope}"]
        for name in members:
            if _is_real(name):
                lines += [_GTKW_REAL, name, _GTKW_HIGHER, *["-"] * _GTKW_HEIGHT]
            else:
                lines += [_GTKW_WORD if signals[name] else _GTKW_BIT, name + signals[name]]
    return "\n".join(lines) + "\n"


def surfer_view(signals: Mapping[str, str]) -> str:
    """A command file of Surfer: the same signals, by module."""
    lines = []
    for scope, members in _groups(list(signals)).items():
        lines += [f"divider_add {scope.removeprefix(f'{TOP}.')}", *(f"variable_add {name}" for name in members)]
    return "\n".join([*lines, "zoom_fit"]) + "\n"
