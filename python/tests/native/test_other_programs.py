"""Motors stepped from C++: by the library and through `rtds serve`, with the bytes of the model link."""

import os
import socket
import struct
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from rtds_host.contract import builtin_robot
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.errors import InputError, OutputError
from rtds_host.link import open_link
from rtds_host.native.serve import listener, serve_runs
from rtds_host.native.source import source_of
from rtds_host.native.words import motor_units

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples" / "cpp"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "python")}


def burger():
    robot = builtin_robot("burger")
    return motor_units(nominal_model(robot), robot)


def model_log():
    """The bytes that both examples write, by the model link."""
    units, out = burger(), bytearray()
    with open_link("model") as link:
        link.set_effects(*units.effects)
        link.set_parameters(*units.parameters)
        w = np.zeros(2, np.float32)
        for k in range(50):
            volts = np.float32(0.2) * np.float32(k), np.float32(6.0) - np.float32(0.25) * np.float32(k)
            got = link.exchange(volts, np.float32(1e-6) * w, 0.032, 1e-3)
            rows = np.empty((32, 4), np.float32)
            rows[:, 0::2], rows[:, 1::2], w = got.currents, got.speeds, got.speeds[-1]
            out += rows.tobytes()
    return bytes(out)


def rtds(*arguments):
    command = [sys.executable, "-m", "rtds_host.cli.main", *map(str, arguments)]
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)


def compiled(command, *parts):
    done = subprocess.run([*command, *map(str, parts)], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stderr == "", done.stderr


def test_the_example_in_cpp_with_the_c_library_writes_the_bytes_of_the_model_link(tmp_path):
    done = rtds("export", "burger", "--to", "c", "--out", tmp_path / "motors")
    assert done.returncode == 0, done.stderr
    compiled(
        ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-c"], tmp_path / "motors/rtds_motor.c", "-o", tmp_path / "m.o"
    )
    program = tmp_path / "step_motors"
    source = EXAMPLES / "step_motors.cpp"
    compiled(["g++", "-O2", "-Wall"], f"-I{tmp_path / 'motors'}", source, tmp_path / "m.o", "-o", program)
    assert subprocess.run([program], capture_output=True, check=True).stdout == model_log()


def test_the_example_in_cpp_reads_the_bytes_of_the_model_link_from_rtds_serve(tmp_path):
    compiled(["g++", "-O2", "-Wall"], EXAMPLES / "serve_client.cpp", "-o", tmp_path / "client")
    place = tmp_path / "motors.sock"
    command = [sys.executable, "-m", "rtds_host.cli.main", "serve", "burger", "--socket", place, "--runs", "2"]
    server = subprocess.Popen(list(map(str, command)), env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
    try:
        assert "listening on" in server.stdout.readline()
        logs = [subprocess.run([tmp_path / "client", place], capture_output=True, check=True).stdout for _ in range(2)]
        assert server.wait(timeout=60) == 0
    finally:
        server.kill()
        server.stdout.close()
    assert logs == [model_log()] * 2
    assert not place.exists()


def test_examples_have_about_fifty_lines():
    for path in EXAMPLES.glob("*.cpp"):
        assert len(path.read_text().splitlines()) <= 55


class Client:
    """A connection to a server in a thread."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        assert self.read() == (1, struct.pack("<Id", 1, 1e-5))

    def read(self):
        head = self.take(8)
        kind, length = struct.unpack("<II", head)
        return kind, self.take(length)

    def take(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part
            data += part
        return data

    def ask(self, kind, payload):
        self.socket.sendall(struct.pack("<II", kind, len(payload)) + payload)
        return self.read()


@pytest.fixture
def port():
    """A server on a free port, for two runs."""
    with listener(None, 0) as (listening, place):
        thread = threading.Thread(target=serve_runs, args=(listening, lambda: open_link("model"), burger(), 2))
        thread.start()
        yield int(place.rpartition(":")[2])
        thread.join(timeout=60)
        assert not thread.is_alive()


def test_what_cannot_be_answered_is_said_and_the_run_goes_on(port):
    client = Client(port)
    exchange = struct.pack("<4fII", 6.0, -3.0, 0.0, 1e-4, 100, 100)
    for kind, payload, text in (
        (9, b"", "kind 9 is unknown"),
        (4, b"123", "24 bytes are needed, got 3"),
        (4, struct.pack("<4fII", 6.0, 6.0, 0.0, 0.0, 0, 1), "0 steps"),
        (4, struct.pack("<4fII", float("nan"), 6.0, 0.0, 0.0, 10, 10), "not finite"),
        (2, struct.pack("<7dI", *burger().parameters, 7), "method 7"),
        (2, struct.pack("<7dI", -1.0, *burger().parameters[1:], 0), "resistance_ohm"),
    ):
        answer, said = client.ask(kind, payload)
        assert answer == 7 and text in said.decode()
    kind, rows = client.ask(4, exchange)
    with open_link("model") as link:
        link.set_parameters(*burger().parameters)
        expected = link.exchange([6.0, -3.0], [0.0, np.float32(1e-4)], 1e-3)
    got = np.frombuffer(rows, "<f4")
    assert (
        kind == 5
        and got[1::2].tobytes() == expected.speeds.tobytes()
        and got[0::2].tobytes() == expected.currents.tobytes()
    )
    client.socket.close()  # in the midst of a run: the next one begins at rest
    client = Client(port)
    assert client.ask(4, exchange) == (kind, rows)
    assert client.ask(2, struct.pack("<7dI", *burger().parameters, 1)) == (3, b"")
    answer, _ = client.ask(4, b"\0" * 5000)
    assert answer == 7
    client.socket.close()


def test_a_socket_that_is_there_already_is_not_touched(tmp_path):
    (tmp_path / "there").write_text("kept")
    with pytest.raises(OutputError, match="there"), listener(tmp_path / "there", None):
        pass
    assert (tmp_path / "there").read_text() == "kept"


def test_what_is_no_robot_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="goes with a diagnosis"):
        source_of("burger", tmp_path / "robot.toml")
    for arguments, text in (
        (["serve", "burger"], "give one of them"),
        (["serve", "nowhere.json", "--port", "0"], "nowhere.json"),
        (["export", "burger", "--to", "fmu", "--out", tmp_path / "a.fmu", "--samples", "2"], "without --actuator"),
    ):
        done = rtds(*arguments)
        assert done.returncode == 2 and text in done.stderr and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
