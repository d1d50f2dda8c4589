"""Whatever happens to the simulator, the host gets one line within the time limit and leaves nothing behind."""

import dataclasses
import itertools
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from link_cases import BURGER, STEP_S

from rtds_host.errors import InputError, LinkError
from rtds_host.link import build, open_link, protocol, tops
from rtds_host.link.rtl import RtlLink

TIMEOUT_S = 1.5
QUICK_BUILD = "icarus" if shutil.which("iverilog") else "verilator"


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def link(simulator):
    with open_link("rtl", sim=simulator) as link:
        link.set_parameters(**BURGER)
        link.exchange([1.0, 1.0], [0.0, 0.0], STEP_S)
        link.timeout_s = TIMEOUT_S  # from here on no answer is expected
        yield link


def failure_of(call):
    """The one line of the LinkError that the call ends in."""
    with pytest.raises(LinkError) as caught:
        call()
    line = str(caught.value)
    assert "\n" not in line
    return line


def one_step(link):
    return link.exchange([1.0, 1.0], [0.0, 0.0], STEP_S)


def test_a_killed_simulator_is_named_with_its_signal(link, simulator):
    os.kill(link.pid, signal.SIGKILL)
    assert f"{simulator} simulator (process {link.pid}): it was killed by SIGKILL" in failure_of(lambda: one_step(link))
    assert failure_of(lambda: one_step(link)) == "the link is closed"


def test_a_hung_simulator_is_given_up_and_ended(link):
    os.kill(link.pid, signal.SIGSTOP)
    assert f"no answer for {TIMEOUT_S:g} s; it has been ended" in failure_of(lambda: one_step(link))
    assert not is_running(link.pid)


def test_a_simulator_that_hangs_in_the_middle_of_an_exchange_is_given_up(link):
    waiter = subprocess.Popen(
        [sys.executable, "-c", f"import os, time; time.sleep(0.3); os.kill({link.pid}, {int(signal.SIGSTOP)})"]
    )
    assert "no answer for" in failure_of(lambda: link.exchange([1.0, 1.0], [0.0, 0.0], 1000.0))
    waiter.wait()
    assert not is_running(link.pid)


def test_close_ends_a_hung_simulator(link):
    os.kill(link.pid, signal.SIGSTOP)
    link.close()
    assert not is_running(link.pid)


def test_close_ends_the_simulator_and_may_be_repeated(link):
    link.close()
    link.close()
    assert not is_running(link.pid)


def test_an_exception_in_the_host_ends_the_simulator():
    with pytest.raises(KeyboardInterrupt), open_link("rtl") as link:
        pid = link.pid
        raise KeyboardInterrupt
    assert not is_running(pid)


def test_a_host_that_is_killed_takes_the_simulator_with_it():
    program = (
        "import sys, time; from rtds_host.link import open_link; print(open_link('rtl').pid, flush=True);"
        " time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as host:
        pid = int(host.stdout.readline())
        host.kill()
    deadline = time.monotonic() + 10.0
    while is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not is_running(pid)


FAKE_BRIDGE = """
import os, socket, sys, time
import cocotb
from rtds_host.link import protocol

@cocotb.test()
async def serve(dut):
    sock = socket.socket(fileno=int(os.environ[protocol.FD_VARIABLE]))
    {body}
"""


def top_with_bridge(folder, body):
    """The usual top with a bridge that misbehaves."""
    (folder / "fake_bridge.py").write_text(FAKE_BRIDGE.format(body=body))
    return dataclasses.replace(tops.TOPS["core"], bridge="fake_bridge")


SILENT = "time.sleep(60)"
# A reply in time but for its end: a byte every so often, which a limit for each piece would wait for.
TRICKLE = "sock.sendall(protocol.HEADER.pack(1, 200)); [(sock.sendall(bytes(1)), time.sleep(0.2)) for _ in range(200)]"
NEXT = "protocol.receive_frame(sock); "
DONE = "protocol.send_frame(sock, protocol.DONE); "


def samples(rows, steps=1):
    """An answer to an exchange, of so many rows."""
    return (
        f"protocol.send_frame(sock, protocol.SAMPLES, protocol.SAMPLES_HEAD.pack(0, {steps}, 0) + bytes(16 * {rows})); "
    )


HELLO = f"""protocol.send_frame(sock, protocol.HELLO, b'{{"version": {protocol.VERSION}, "simulator": "fake"}}'); """


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (HELLO + "sock.close(); time.sleep(60)", "it closed the link without leaving; it has been ended"),
        (HELLO + "protocol.receive_frame(sock); os._exit(7)", "it ended with exit status 7"),
        (HELLO + "protocol.receive_frame(sock); protocol.send_frame(sock, 77)", "a frame of kind 77 instead of"),
        (HELLO + "protocol.receive_frame(sock); sock.sendall(b'\\xff' * 8); time.sleep(60)", "cannot make sense"),
        (HELLO + "protocol.receive_frame(sock); protocol.send_frame(sock, protocol.FAILED, b'no way')", "no way"),
        (SILENT, "no answer for 1.5 s; it has been ended"),
        ("sys.stderr.write('first\\nlast words\\n'); sys.stderr.flush(); os._exit(3)", "exit status 3; it said:"),
        (
            'protocol.send_frame(sock, protocol.HELLO, b\'{"version": 99, "simulator": "x"}\'); time.sleep(60)',
            f"it speaks version 99 of the link, not {protocol.VERSION}",
        ),
        ("protocol.send_frame(sock, protocol.HELLO, b'{\"version\"'); time.sleep(60)", "not a greeting of the link"),
        ("protocol.send_frame(sock, protocol.HELLO, b'\\xff'); time.sleep(60)", "not a greeting of the link"),
        ("protocol.send_frame(sock, protocol.HELLO, b'[2]'); time.sleep(60)", "not a greeting of the link"),
        (TRICKLE, "no answer for 1.5 s; it has been ended"),
        (HELLO + NEXT + TRICKLE, "no answer for 1.5 s; it has been ended"),
        (
            HELLO + NEXT + "protocol.send_frame(sock, protocol.DONE, bytes(3)); time.sleep(60)",
            "its answer has 3 bytes, 0 are due",
        ),
        (HELLO + NEXT + DONE + NEXT + samples(0) + "time.sleep(60)", "has 16 bytes, 32 are due for 1 rows of samples"),
        (HELLO + NEXT + DONE + NEXT + samples(2) + "time.sleep(60)", "has 48 bytes, 32 are due for 1 rows of samples"),
        (
            HELLO + NEXT + DONE + NEXT + "protocol.send_frame(sock, protocol.SAMPLES, bytes(5)); time.sleep(60)",
            "has 5 bytes, at least 16 are due",
        ),
        (HELLO + NEXT + DONE + NEXT + samples(1, steps=2) + "time.sleep(60)", "counted 2 steps where 1 were asked for"),
        (HELLO + NEXT + "protocol.send_frame(sock, protocol.FAILED, b'two\\nlines'); time.sleep(60)", "two lines"),
    ],
)
def test_a_simulator_that_misbehaves_gives_one_line(tmp_path, monkeypatch, body, says):
    monkeypatch.syspath_prepend(str(tmp_path))
    top = top_with_bridge(tmp_path, body)

    def use():
        with RtlLink(top=top, start_timeout_s=TIMEOUT_S if body in (SILENT, TRICKLE) else 30.0) as link:
            link.timeout_s = TIMEOUT_S
            link.set_parameters(**BURGER)
            one_step(link)

    assert says in failure_of(use)


def copy_of_sources(folder):
    """A source tree of its own, to be broken."""
    for name in ("rtl/fp", "rtl/core", "rtl/effects", "sim"):
        shutil.copytree(tops.ROOT / name, folder / name)
    return dataclasses.replace(tops.TOPS["core"], root=folder)


def test_a_failing_build_quotes_the_compiler_keeps_its_log_and_leaves_no_build(simulator, tmp_path, monkeypatch):
    top = copy_of_sources(tmp_path / "tree")
    (tmp_path / "tree/rtl/core/rtds_core.v").write_text("module rtds_core (input wire clk_i; endmodule\n")
    monkeypatch.setattr(build, "BUILDS", tmp_path / "builds")
    line = failure_of(lambda: build.build(top, simulator, say=lambda _: None))
    assert "failed (exit status" in line
    assert "rtds_core.v:1" in line
    (log,) = [path for path in (tmp_path / "builds").iterdir() if not path.name.endswith(".lock")]
    assert line.endswith(f"all of it: {log}") and "rtds_core.v:1" in log.read_text()


def test_a_build_that_succeeds_takes_the_log_of_a_failed_one_away(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "BUILDS", tmp_path / "builds")
    top = copy_of_sources(tmp_path / "tree")
    good = {name: getattr(build.compiling, name) for name in ("run",)}
    with monkeypatch.context() as broken:
        broken.setattr(build.compiling, "run", lambda what, *rest: good["run"](what, [["false"]], *rest[1:]))
        assert "failed (exit status 1): no output; all of it: " in failure_of(lambda: build.build(top, QUICK_BUILD))
    build.build(top, QUICK_BUILD, say=lambda _: None)
    assert not list((tmp_path / "builds").glob("*.log"))


def test_a_core_that_never_gets_ready_is_noticed_by_the_top(tmp_path, monkeypatch):
    top = copy_of_sources(tmp_path / "tree")
    core = tmp_path / "tree/rtl/core/rtds_core.v"
    core.write_text(core.read_text().replace("assign ready_o = ", "assign ready_o = 1'b0 & "))
    monkeypatch.setattr(build, "BUILDS", tmp_path / "builds")
    with RtlLink(sim=QUICK_BUILD, top=top, progress=lambda _: None) as link:
        link.set_parameters(**BURGER)
        assert "no ready or valid for thousands of clocks" in failure_of(lambda: one_step(link))


@pytest.mark.parametrize(
    ("simulator", "missing", "package"),
    [
        ("icarus", "iverilog", "apt-get install iverilog"),
        ("icarus", "vvp", "apt-get install iverilog"),
        ("verilator", "g++", "apt-get install g++"),
    ],
)
def test_a_missing_program_is_named_with_its_package(monkeypatch, simulator, missing, package):
    monkeypatch.setattr(build.shutil, "which", lambda name: None if name == missing else f"/usr/bin/{name}")
    line = failure_of(lambda: build.build(tops.TOPS["core"], simulator))
    assert line == f"{missing} is not installed, it is needed to simulate the RTL: {package}"


def test_missing_sources_are_named(tmp_path):
    top = dataclasses.replace(tops.TOPS["core"], root=tmp_path)
    assert f"{tmp_path}/rtl/fp/fp.f: cannot read" in failure_of(lambda: build.build(top, "verilator"))


def test_a_place_that_cannot_hold_a_build_is_named(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(build, "BUILDS", tmp_path / "file" / "sim")
    line = failure_of(lambda: build.build(tops.TOPS["core"], "verilator"))
    assert "cannot build there" in line


def test_two_processes_that_build_at_once_build_once(tmp_path):
    program = (
        "import sys; from pathlib import Path; from rtds_host.link import build, tops; "
        "build.BUILDS = Path(sys.argv[2]); "
        "print(build.build(tops.TOPS['core'], sys.argv[1]).command)"
    )
    command = [sys.executable, "-c", program, QUICK_BUILD, str(tmp_path / "builds")]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    results = [process.communicate() for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert len({out for out, _ in results}) == 1
    assert sum("compiling the" in err for _, err in results) == 1
    folders = [path for path in (tmp_path / "builds").iterdir() if path.is_dir()]
    assert len(folders) == 1 and not folders[0].name.startswith(".")


@pytest.mark.parametrize("damage", ["a byte", "cut", "gone", "no hash"])
def test_a_damaged_simulator_is_noticed_and_built_again(tmp_path, monkeypatch, damage):
    monkeypatch.setattr(build, "BUILDS", tmp_path / "builds")
    said = []
    build.build(tops.TOPS["core"], QUICK_BUILD, say=said.append)
    folder = next(path for path in build.BUILDS.iterdir() if path.is_dir())
    program = next(folder.glob("sim*"))
    whole = program.read_bytes()
    if damage == "a byte":
        program.write_bytes(whole[:1000] + bytes([whole[1000] ^ 1]) + whole[1001:])
    elif damage == "cut":
        program.write_bytes(whole[:1000])
    elif damage == "gone":
        program.unlink()
    else:
        (folder / build.HASH).unlink()
    said.clear()
    build.build(tops.TOPS["core"], QUICK_BUILD, say=said.append)
    assert len(said) == 2 and "the simulator there is not the one that was built; it is built again" in said[0]
    with RtlLink(sim=QUICK_BUILD) as link:
        link.set_parameters(**BURGER)
        one_step(link)
    said.clear()
    build.build(tops.TOPS["core"], QUICK_BUILD, say=said.append)
    assert said == []


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"sim": "modelsim"}, "sim: 'modelsim' is unknown, choose one of verilator, icarus"),
        ({"step_clocks": 0}, "step_clocks: 0 must be 'min' or a whole number from 1 to 65535"),
        ({"step_clocks": "fast"}, "step_clocks: 'fast' must be"),
        ({"step_clocks": 65536}, "step_clocks: 65536 must be"),
    ],
)
def test_options_out_of_range_are_refused_before_anything_is_built(options, says):
    with pytest.raises(InputError) as caught:
        RtlLink(**options)
    assert says in str(caught.value)


# ---- the time limit of an answer -------------------------------------------------------------------------------------


class Starving:
    """What a simulator has waited for a processor: so much at each look, up to a limit."""

    def __init__(self, each_s, limit_s):
        self.each_s, self.limit_s, self.now = each_s, limit_s, 0.0

    def __call__(self):
        self.now = min(self.now + self.each_s, self.limit_s)
        return self.now


def test_time_without_a_processor_does_not_count_and_comes_to_an_end(monkeypatch):
    clock = itertools.count(0.0, 0.005)
    monkeypatch.setattr(protocol, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    ours, theirs = socket.socketpair()
    with ours, theirs:
        starving = Starving(0.01, 0.05)
        with pytest.raises(TimeoutError):
            protocol.receive_frame(ours, protocol.Deadline(0.02, starving))
        assert starving.now == starving.limit_s


def test_what_came_in_time_is_taken_though_the_host_looks_late():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        protocol.send_frame(theirs, protocol.DONE, b"late")
        assert protocol.receive_frame(ours, protocol.Deadline(-1.0)) == (protocol.DONE, b"late")
        with pytest.raises(TimeoutError):
            protocol.receive_frame(ours, protocol.Deadline(-1.0))
