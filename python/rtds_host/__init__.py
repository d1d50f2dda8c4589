"""A mobile robot's motors simulated in real time, and the instrument that says why the simulator differs from the
robot.

The functions of this package, each described in `rtds_host.api`:

- `read_case(folder)` reads the logs of a robot, `diagnose(case)` says which unmodelled effects make them differ from a
  simulation, `predict(run, robot, diagnosis)` replays a run from its commands;
- `run(scenario)` drives a scenario in the real-time simulator, `close(case)` puts a diagnosis into that simulator and
  measures the gap there before and after;
- `import_case(sources, out)` turns recordings into a case, `export(diagnosis, to)` writes the robot for another
  simulator, `plan(robot)` makes the manoeuvre that would tell most.

`plots` draws runs and diagnoses into matplotlib's axes.

`import rtds_host` loads none of what they need (0.01 s); the first call does.
"""

from __future__ import annotations

import os

# One thread a BLAS call, before numpy is loaded: the program spreads its work itself (two processes of two threads
# each on two cores take ninety times as long), and the same sums in the same order give the same file everywhere.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def _has_fused_avx2(cpuinfo: str = "/proc/cpuinfo") -> bool:
    """Whether each core of this computer has the instructions AVX2 and FMA; False where that cannot be read."""
    try:
        with open(cpuinfo) as file:
            cores = [set(line.split()) for line in file if line.startswith("flags")]
    except OSError:
        return False
    return bool(cores) and all({"avx2", "fma"} <= core for core in cores)


# OpenBLAS has a kernel for each kind of processor, whose sums differ in the last digit. A search whose explanations are
# about as good as each other then takes another one. All with AVX2 can use this kernel.
if _has_fused_avx2():
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

__version__ = "0.1.0"

__all__ = [
    "InputError",
    "LinkError",
    "OutputError",
    "RtdsError",
    "close",
    "diagnose",
    "export",
    "import_case",
    "plan",
    "plots",
    "predict",
    "read_case",
    "run",
]

# For tools that read types, which know it by its name. `typing` itself takes longer to load than all else here, and a
# Ctrl-C in that time would meet nobody who answers it.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from rtds_host import plots
    from rtds_host.api import close, diagnose, export, import_case, plan, predict, read_case, run
    from rtds_host.errors import InputError, LinkError, OutputError, RtdsError


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "plots":
        import importlib

        return importlib.import_module("rtds_host.plots")
    from rtds_host import api, errors

    return getattr(errors if name.endswith("Error") else api, name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
