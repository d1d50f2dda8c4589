"""The simulation tops: what each is made of, how it is clocked, and what serves its link."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rtds_host.errors import LinkError

_PACKAGE = Path(__file__).resolve().parents[1]
_CHECKOUT = _PACKAGE.parents[1]


def _places() -> tuple[Path, Path]:
    """(folder with `rtl` and `sim`, folder of the builds): those of the checkout, or of an installed package its own
    copy and the user's cache."""
    if (_CHECKOUT / "rtl" / "core" / "core.f").is_file():
        return _CHECKOUT, _CHECKOUT / "build" / "sim"
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return _PACKAGE / "hardware", Path(cache) / "rtds" / "sim"


ROOT, BUILDS = _places()
NATIVE = "sim/native"
WAVE_VIEW = "sim/rtds_wave_view.v"


@dataclass(frozen=True)
class Top:
    """A simulation top and what belongs to it.

    Attributes
    ----------
    module : name of the top module.
    file_lists : `.f` lists, relative to `root`.
    sources : further Verilog files, relative to `root`; the top itself among them.
    clocks : (port, half period in ps) of each clock that the C++ main drives. On Icarus the top makes its own clocks
        (it is compiled with RTDS_CLOCK_INSIDE).
    posedge_only : there is one clock, nothing depends on its falling edge or its level, and the design makes no event
    of
        its own (a derived clock).
    sync : one-bit output that toggles when the bridge is wanted.
    control : Verilator control file that makes the bridge's ports public.
    bridge : Python module below ``sim/`` with the cocotb test that serves the link; "" where the main serves it itself,
        without cocotb (Verilator only, and then without `sync` and `control`).
    main : C++ main of the Verilator build, below the source tree.
    parameters : (name, value) of the top module's parameters that are not left at their defaults.
    idle : (port, register, register, clocks) of a `posedge_only` top, or (): while the port is 1 nothing looks at the
    first
        register, which counts clocks, but for whether it has reached the second, and after so many clocks nothing else
        moves. The C++ main jumps such clocks.
    native : sums and products are the host's own arithmetic on Verilator (`sim/native`): the same results, less time.
    phases : nets or registers below the top of a `posedge_only` top, or (): their values together number the clocks of
        a step, and the last is high in the clock that begins one. The C++ main has an evaluation for each
        (`rtds_host.link.pinning`).
    still : (port, register) pairs of a top with `phases` that are equal while no request begins.
    profile : this build watches itself, to find what those evaluations are compiled for.
    waves : this build can write waveforms (Verilator only; with `bridge`). Its file `SIGNALS` lists the signals.
    root : folder to which the names are relative: the source tree.
    """

    module: str
    file_lists: tuple[str, ...]
    sources: tuple[str, ...]
    clocks: tuple[tuple[str, int], ...]
    posedge_only: bool
    sync: str
    control: str
    bridge: str
    main: str = "sim/verilator_main.cpp"
    parameters: tuple[tuple[str, int], ...] = ()
    idle: tuple[str, str, str, int] | tuple[()] = ()
    native: bool = False
    phases: tuple[str, ...] = ()
    still: tuple[tuple[str, str], ...] = ()
    profile: bool = False
    waves: bool = False
    root: Path = ROOT

    @property
    def plain(self) -> Top:
        """The same with the RTL's own operators and one evaluation for all clocks: Verilator's model as it comes."""
        return replace(self, native=False, phases=(), still=(), profile=False)

    @property
    def traced(self) -> Top:
        """`plain`, able to write waveforms: every signal is the RTL's own."""
        return replace(self.plain, waves=True, sources=(*self.sources, WAVE_VIEW))

    def files(self) -> list[Path]:
        """Every Verilog file of the design itself, in order.

        Raises
        ------
        LinkError : a list or file is missing (for instance an installation without the source tree).
        """
        paths: list[Path] = []
        for file_list in self.file_lists:
            paths += _read_file_list(self.root / file_list, self.root)
        paths += [self.root / name for name in self.sources]
        paths = list(dict.fromkeys(paths))
        for path in paths:
            if not path.is_file():
                raise LinkError(f"{path}: no such file; the rtl link needs the source tree")
        return paths

    def compiled_files(self) -> list[Path]:
        """The files that Verilator is given: with `native`, operators of `sim/native` in place of the RTL's.

        Raises
        ------
        LinkError : as `files`.
        """
        if not self.native:
            return self.files()
        native = {path.name: path for path in (self.root / NATIVE).glob("*.v")}
        return [native.get(path.name, path) for path in self.files()]

    def headers(self) -> list[Path]:
        """The Verilog headers next to the files, which any of them may include."""
        return sorted(header for folder in {path.parent for path in self.files()} for header in folder.glob("*.vh"))

    def include_flags(self) -> list[str]:
        """-I of the headers' folders, for both simulators."""
        return [f"-I{folder}" for folder in sorted({header.parent for header in self.headers()})]


def _read_file_list(path: Path, root: Path) -> list[Path]:
    """The files of a `.f` list: a path a line, from the list's own folder or from the root; `-f` includes a list."""
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise LinkError(f"{path}: cannot read ({error.strerror}); the rtl link needs the source tree") from error
    found: list[Path] = []
    for line in lines:
        entry = line.split("//")[0].split("#")[0].strip()
        if not entry:
            continue
        name = entry.removeprefix("-f").strip()
        sibling = path.parent / name
        target = (sibling if sibling.is_file() else root / name).resolve()
        found += _read_file_list(target, root) if entry.startswith("-f") else [target]
    return found


TOPS: Mapping[str, Top] = {
    "core": Top(
        module="rtds_sim_top",
        file_lists=("rtl/fp/fp.f", "rtl/core/core.f"),
        sources=("sim/rtds_sim_top.v",),
        clocks=(("clk_i", 10_000),),
        posedge_only=True,
        sync="sync_o",
        control="sim/rtds_sim_top.vlt",
        bridge="bridge_core",
        parameters=(("EFFECTS", 0),),
        idle=("idle_o", "period_q", "step_clocks_q", 3),
        native=True,
        phases=("u_core.u_sequencer.slot_q", "strobe"),
        still=(("go_i", "go_q"), ("fx_go_i", "fx_go_q")),
    ),
    "hps": Top(
        module="rtds_hps",
        file_lists=("rtl/hps/hps.f",),
        sources=(),
        clocks=(),
        posedge_only=False,
        sync="",
        control="",
        bridge="",
        main="sim/hps_main.cpp",
        native=True,
    ),
    "chip": Top(
        module="rtds_chip",
        file_lists=("rtl/top/top.f",),
        sources=(),
        clocks=(),
        posedge_only=False,
        sync="",
        control="",
        bridge="",
        main="sim/chip_main.cpp",
    ),
}
