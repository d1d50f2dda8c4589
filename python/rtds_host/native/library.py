"""Compiles the C library, and calls it: `NativePair` (ctypes) and `NativeLink`, a `Link` on top of it."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rtds_host.errors import InputError, LinkError
from rtds_host.link.compiling import first_error
from rtds_host.link.configured import ConfiguredLink
from rtds_host.motor.effect_program import CELLS, CONSTANTS, SIDES, TABLES
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import METHODS, PARAMETER_NAMES, Parameters
from rtds_host.vectors import Vector

SOURCES = Path(__file__).parent / "c"
# Order of operations as written, in single precision; no warning about the other compiler's pragmas.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-Wall", "-Wextra", "-Wno-unknown-pragmas")
COMPILERS = ("cc", "gcc", "clang")
STATUS = {
    1: "a parameter or a coefficient is outside single precision",
    2: "a number of steps or a method that is none",
}
_BUILD_TIMEOUT_S = 120.0


def compiler() -> str:
    """The C compiler: `CC` of the environment, or the first that is there of `COMPILERS`.

    Raises
    ------
    LinkError : there is none.
    """
    for name in (os.environ.get("CC"), *COMPILERS):
        if name and shutil.which(name):
            return name
    raise LinkError(f"no C compiler: none of {', '.join(COMPILERS)} is installed, and CC names none")


def compile_shared(sources: Sequence[Path], target: Path, include: Sequence[Path] = (), hide: bool = False) -> None:
    """Compile C sources into a shared library.

    Parameters
    ----------
    target : the library to write.
    include : folders of further headers.
    hide : only what the sources declare visible can be called.

    Raises
    ------
    LinkError : no compiler, or it failed; the message quotes its own line.
    """
    folders = [f"-I{folder}" for folder in (SOURCES, *include)]
    hidden = ["-fvisibility=hidden"] if hide else []
    command = [compiler(), *FLAGS, *hidden, *folders, "-shared", "-o", target, *sources, "-lm"]
    try:
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, check=False, timeout=_BUILD_TIMEOUT_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise LinkError(f"{command[0]}: {error}") from error
    if done.returncode != 0:
        raise LinkError(f"compiling {target.name} failed: {first_error(done.stderr)[:300]}")


class _Effects(ctypes.Structure):
    _fields_ = (
        ("on", ctypes.c_int32),
        ("delay", ctypes.c_int32),
        ("stride", ctypes.c_int32),
        ("constants", ctypes.c_float * (SIDES * len(CONSTANTS))),
        ("tables", ctypes.c_float * (SIDES * len(TABLES) * CELLS * 2)),
    )


class _Pair(ctypes.Structure):
    _fields_ = (
        ("state", ctypes.c_float * (SIDES * 4)),
        ("step_count", ctypes.c_uint32),
        # Room for what is private there, more than it takes.
        ("private", ctypes.c_ubyte * 131072),
    )


_DOUBLES = ctypes.c_double * len(PARAMETER_NAMES)
_FLOATS = ctypes.c_float * SIDES


class NativePair:
    """Both motors in C.

    Parameters
    ----------
    library : a library made by `compile_shared` of `rtds_motor.c`.
    """

    def __init__(self, library: Path) -> None:
        self._c = ctypes.CDLL(str(library))
        self._pair = _Pair()
        self._c.rtds_init(ctypes.byref(self._pair))

    def set_parameters(self, values: np.ndarray, method: str) -> None:
        """(2, 7) parameters of [left, right], SI.

        Raises
        ------
        InputError : they give no usable coefficients.
        """
        sides = [_DOUBLES(*map(float, side)) for side in values]
        self._check(self._c.rtds_set_parameters(ctypes.byref(self._pair), *sides, METHODS.index(method)))

    def load(self, words: EffectWords) -> None:
        """Take tables, constants and delay over, and run with them."""
        self.set_effects(words.on, words.constants, words.tables, words.delay, words.stride)

    def set_effects(self, on: bool, constants: np.ndarray, tables: np.ndarray, delay: int, stride: int) -> None:
        """`rtds_set_effects`: (2, 15) constants and (2, 6, 256, 2) tables, float32.

        Raises
        ------
        InputError : a delay that the unit cannot hold.
        """
        effects = _Effects(int(on), delay, stride)
        effects.constants[:] = np.asarray(constants, np.float32).ravel().tolist()
        effects.tables[:] = np.asarray(tables, np.float32).ravel().tolist()
        self._check(self._c.rtds_set_effects(ctypes.byref(self._pair), ctypes.byref(effects)))

    def step(self, v: Vector, t: Vector, n_steps: int, sample_every: int | None = None) -> np.ndarray:
        """As `rtds_host.motor.MotorPair.step`: (m, 4) float32, i_l w_l i_r w_r."""
        every = n_steps if sample_every is None else sample_every
        out = np.empty((-(-n_steps // every), 4), np.float32)
        self._check(
            self._c.rtds_step(
                ctypes.byref(self._pair), _FLOATS(*v), _FLOATS(*t), n_steps, every, ctypes.c_void_p(out.ctypes.data)
            )
        )
        return out

    def clear(self) -> None:
        """State of motors and effects to zero."""
        self._c.rtds_clear(ctypes.byref(self._pair))

    @property
    def state(self) -> np.ndarray:
        """(2, 4) float32: i, w, i_lo, w_lo of [left, right]."""
        return np.array(self._pair.state, np.float32).reshape(SIDES, 4)

    @property
    def step_count(self) -> int:
        """Steps since the start or the last `clear`."""
        return self._pair.step_count

    @staticmethod
    def _check(status: int) -> None:
        if status in STATUS:
            raise InputError(f"motor library: {STATUS[status]}")


class NativeLink(ConfiguredLink):
    """`NativePair` as a `Link`."""

    def __init__(self, library: Path) -> None:
        self.pair = NativePair(library)

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        self.pair.set_parameters(words.side_values(values), method)
        self.pair.load(words)

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, sample_steps: int) -> np.ndarray:
        return self.pair.step(v, t, steps, sample_steps)
