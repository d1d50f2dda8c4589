"""The simulator of the RTL is built where a machine offers little: few programs, no environment, a space in
every path.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import rtds_host
from rtds_host.errors import LinkError
from rtds_host.link import compiling

# All that a build may start: the compiler, and what it starts itself. No `python`, no `make`, though the test's own
# environment has them.
PROGRAMS = ("g++", "as", "ld")

BUILD_AND_STEP = """
import dataclasses, sys
from pathlib import Path
from rtds_host.link import build
from rtds_host.link.rtl import RtlLink
from rtds_host.link.tops import TOPS
from link_cases import BURGER, STEP_S

folder = Path(sys.argv[1])
build.BUILDS = folder / "builds"
tree = folder / "tree"
top = dataclasses.replace(TOPS["core"], root=tree, main=str(tree / TOPS["core"].main))
with RtlLink(top=top) as link:
    link.set_parameters(**BURGER)
    print((link.exchange([1.0, 1.0], [0.0, 0.0], 10 * STEP_S).speeds[-1] > 0.0).all())
"""


def bare_environment(folder):
    """PATH with `PROGRAMS` alone, and the import path with a space in it; nothing else."""
    programs = folder / "bin"
    programs.mkdir()
    for name in PROGRAMS:
        (programs / name).symlink_to(shutil.which(name))
    site = folder / "site packages"
    site.symlink_to(sysconfig.get_paths()["purelib"])
    python = Path(rtds_host.__file__).parents[1]
    return {"PATH": str(programs), "PYTHONPATH": os.pathsep.join(map(str, (site, python, Path(__file__).parent)))}


def test_a_build_needs_no_make_no_program_named_python_and_no_path_without_spaces(tmp_path):
    folder = tmp_path / "with a space"
    for name in ("rtl", "sim"):
        shutil.copytree(Path(__file__).parents[3] / name, folder / "tree" / name)
    command = [sys.executable, "-c", BUILD_AND_STEP, str(folder)]
    done = subprocess.run(
        command, env=bare_environment(folder), cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "True"
    # One that watched itself, to find what each clock of a step holds, and the one that was made of it.
    built = [path for path in (folder / "builds").iterdir() if path.is_dir()]
    assert len(built) == 2
    for path in built:
        assert sorted(file.name for file in path.iterdir()) == ["sha256", "sim", "sim.command"]


@pytest.mark.parametrize(
    ("log", "line"),
    [
        ("a.cpp: In function f:\na.cpp:3:5: error: x was not declared\na.cpp:9:1: error: y",
            "a.cpp:3:5: error: x was not declared"),
        ("main.cpp:1:10: fatal error: gone.h: No such file\ncompilation terminated.",
            "main.cpp:1:10: fatal error: gone.h: No such file"),
        ("ld: a.o: in function f:\na.cpp:(.text+0x5): undefined reference to `g'\n"
         "collect2: error: ld returned 1 exit status",
         "a.cpp:(.text+0x5): undefined reference to `g'"),
        ("/usr/bin/ld: cannot find -lcocotbvpi_verilator: No such file\ncollect2: error: ld returned 1 exit status",
         "/usr/bin/ld: cannot find -lcocotbvpi_verilator: No such file"),
        ("%Warning-WIDTH: a.v:2: width\n%Error: a.v:1:5: syntax error\n%Error: Exiting due to 1 error(s)",
            "%Error: a.v:1:5: syntax error"),
        ("working on it\nstopped\n", "stopped"),
        ("", "no output"),
    ],
)  # fmt: skip
def test_of_a_log_the_line_that_says_what_was_wrong_is_quoted(log, line):
    assert compiling.first_error(log) == line


def write_plan(folder, source):
    """A model of one C++ file, as Verilator's JSON lists it."""
    (folder / "model.cpp").write_text(source)
    (folder / "model.h").write_text("#define ANSWER 42\n")
    plan = folder / "Vtop.json"
    kinds = ("coverage", "system_c", "use_timing", "trace", "trace_fst", "trace_vcd", "trace_saif")
    lists = ("user_classes", "global")  # those of the model that are empty are left out
    plan.write_text(json.dumps({
        "system": {"verilator_root": str(folder)},
        "options": dict.fromkeys(kinds, False),
        "sources": {**{key: [] for key in lists}, "classes_fast": [str(folder / "model.cpp")]},
    }))  # fmt: skip
    return plan


def compile_it(plan):
    program = plan.parent / "program"
    compiling.compile_all(plan, program, "-O0", ["-DONE=1"], [], plan.parent / "log", 60.0)
    return subprocess.run([program], check=False).returncode, program.stat().st_mtime_ns


def test_only_what_changed_is_compiled_again_headers_included(tmp_path):
    folder = tmp_path / "with a space"
    folder.mkdir()
    plan = write_plan(folder, '#include "model.h"\nint main() { return ANSWER * ONE; }\n')
    status, first = compile_it(plan)
    assert (status, compile_it(plan)) == (42, (42, first))
    (folder / "model.h").write_text("#define ANSWER 43\n")
    assert compile_it(plan)[0] == 43


def test_a_compiler_that_fails_leaves_its_line_in_the_message_and_all_of_it_in_the_log(tmp_path):
    plan = write_plan(tmp_path, "int main() { return nothing; }\n")
    with pytest.raises(
        LinkError, match=r"compiling the simulator failed \(exit status 1\): .*model.cpp:1:21: error: .nothing. was not"
    ):
        compile_it(plan)
    assert "int main() { return nothing; }" in (tmp_path / "log").read_text()


def test_a_list_that_is_none_is_named(tmp_path):
    (tmp_path / "Vtop.json").write_text("{}")
    with pytest.raises(LinkError, match="Vtop.json: Verilator's list of what to compile is not usable"):
        compile_it(tmp_path / "Vtop.json")
