"""Steps a second over each way to the motors, as ratios to the model in process: `python -m rtds_host.bench.ways`."""

from __future__ import annotations

import argparse
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from rtds_host.bench.measure import DRY, STEP_S, measure_rtl, set_burger
from rtds_host.cleanup import temporary_folder
from rtds_host.errors import RtdsError
from rtds_host.link import Link, open_link
from rtds_host.link.protocol import EXCHANGE, HEADER
from rtds_host.native.library import SOURCES, NativeLink, compile_shared
from rtds_host.native.serve import EXCHANGE_PAYLOAD, HELLO_PAYLOAD, listener, serve_runs
from rtds_host.native.words import MotorUnits, motor_units

# Steps of an exchange: an engine's step of 32 ms, one of 1 ms, and the motors' own.
EXCHANGES = (3200, 100, 1)


def _rate(exchange: Callable[[int], None], steps: int, seconds: float) -> float:
    """Steps a second of this process' time on a processor, a server's thread included."""
    exchange(steps)
    made, start, used = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - start < seconds:
        exchange(steps)
        made += steps
    return made / max(time.process_time() - used, 1e-9)


def _of_link(link: Link, effects: bool) -> Callable[[int], None]:
    if effects:
        link.set_effects(DRY, DRY, None)
    set_burger(link)

    def exchange(steps: int) -> None:
        link.exchange((6.0, 5.0), (0.0, 1e-5), steps * STEP_S)

    return exchange


def _units(effects: bool) -> MotorUnits:
    from dataclasses import replace

    from rtds_host.contract import builtin_robot
    from rtds_host.diagnosis.replay.model import nominal_model
    from rtds_host.motor.effect_tables import tables_of

    robot = builtin_robot("burger")
    units = motor_units(nominal_model(robot), robot)
    if not effects:
        return units
    words = tables_of(DRY, DRY, None, units.parameters)
    return replace(units, words=words, effects=(DRY, DRY, None))


def _served(place: Path, units: MotorUnits) -> tuple[Callable[[int], None], socket.socket]:
    """An exchange through a Unix socket with a server in a thread of this process, and the socket."""
    listening = threading.Event()

    def run() -> None:
        with listener(place, None) as (server, _):
            listening.set()
            serve_runs(server, lambda: open_link("model"), units, 1)

    threading.Thread(target=run, daemon=True).start()
    listening.wait()
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(str(place))
    connection.recv(HEADER.size + HELLO_PAYLOAD.size, socket.MSG_WAITALL)

    def exchange(steps: int) -> None:
        request = EXCHANGE_PAYLOAD.pack(6.0, 5.0, 0.0, 1e-5, steps, steps)
        connection.sendall(HEADER.pack(EXCHANGE, len(request)) + request)
        connection.recv(HEADER.size + 16, socket.MSG_WAITALL)

    return exchange, connection


def _fmu(folder: Path, units: MotorUnits) -> Callable[[int], None] | None:
    """A step of the motors' FMU through fmpy, None where fmpy is not installed."""
    try:
        import fmpy
        from fmpy.fmi3 import FMU3Slave
    except ImportError:
        return None
    from rtds_host.export import fmu

    (folder / "motors.fmu").write_bytes(fmu.build(fmu.motors(units, "motors", "")))
    described = fmpy.read_model_description(folder / "motors.fmu")
    unpacked = fmpy.extract(str(folder / "motors.fmu"), str(folder / "unpacked"))
    slave = FMU3Slave(guid=described.guid, unzipDirectory=unpacked, modelIdentifier="motors", instanceName="it")
    slave.instantiate()
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    made = 0

    def exchange(steps: int) -> None:
        nonlocal made
        slave.setFloat64([1, 2, 3, 4], [6.0, 5.0, 0.0, 1e-5])
        slave.doStep(made * STEP_S, steps * STEP_S)
        slave.getFloat64([5, 6, 7, 8])
        made += steps

    return exchange


def _rtl_rate(effects: bool, steps: int, seconds: float) -> float:
    """Steps a second of the simulator's time on a processor; this process, which waits for it, is not in it."""
    return measure_rtl("verilator", "min", steps, seconds, effects=effects).times_real_time_of_a_free_core / STEP_S


def _dcmotor_rates(folder: Path, seconds: float) -> tuple[float, float, float]:
    """MuJoCo's steps a second for a robot with two `<dcmotor>`: the file alone, and with the module of its driver; and
    the length of a step, s."""
    import mujoco

    from rtds_host.contract import builtin_robot
    from rtds_host.diagnosis.replay.model import nominal_model
    from rtds_host.export import mjcf
    from rtds_host.export.figures import figures_of
    from rtds_host.export.mujoco_replay import driver_class

    robot = builtin_robot("burger")
    (folder / "robot.xml").write_text(mjcf.write(figures_of(nominal_model(robot), robot), "", "dcmotor"))
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    driver, data, other = driver_class()(model), mujoco.MjData(model), mujoco.MjData(model)
    other.ctrl[:2] = 6.0, 5.0

    def with_module(steps: int) -> None:
        for _ in range(steps):
            driver.step(data, 6.0, 5.0)

    alone = _rate(lambda steps: mujoco.mj_step(model, other, steps), 100, seconds)
    return alone, _rate(with_module, 100, seconds), float(model.opt.timestep)


def run(seconds: float) -> None:
    """Measure and print, line by line."""
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} before the start; {seconds:g} s a figure")
    print("steps a second of processor time, both motors, and times the model's; by steps of an exchange\n")
    print(f"{'way':<44}" + "".join(f"{f'{steps} steps':>22}" for steps in EXCHANGES))
    for effects in (False, True):
        base: list[float] = []
        units = _units(effects)
        with temporary_folder() as folder:
            compile_shared([SOURCES / "rtds_motor.c"], folder / "motors.so")
            served, connection = _served(folder / "s", units)
            ways = {
                "model link": _of_link(open_link("model"), effects),
                "C library by ctypes": _of_link(NativeLink(folder / "motors.so"), effects),
                "rtds serve, Unix socket": served,
                "FMU by fmpy": _fmu(folder, units),
            }
            for name, exchange in ways.items():
                if exchange is None:
                    print(f"{name:<44}fmpy is not installed")
                    continue
                rates = [_rate(exchange, steps, seconds) for steps in EXCHANGES]
                base = base or rates
                cells = "".join(
                    f"{f'{rate:.3g} ({rate / one:.2f})':>22}" for rate, one in zip(rates, base, strict=True)
                )
                print(f"{name + ', effects' * effects:<44}{cells}", flush=True)
            connection.close()
        rates = [_rtl_rate(effects, steps, seconds) for steps in EXCHANGES]
        cells = "".join(f"{f'{rate:.3g} ({rate / one:.2g})':>22}" for rate, one in zip(rates, base, strict=True))
        print(f"{'RTL link, Verilator' + ', effects' * effects:<44}{cells}", flush=True)
    with temporary_folder() as folder:
        alone, with_module, step_s = _dcmotor_rates(folder, seconds)
    print(f"\nrobot with two <dcmotor> in MuJoCo, steps of {step_s * 1e3:g} ms a second of processor time")
    print(f"{'file alone':<44}{alone:>22.3g}\n{'with the module of its driver':<44}{with_module:>22.3g}")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m rtds_host.bench.ways", description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0, help="measuring time of each figure")
    try:
        run(parser.parse_args().seconds)
    except RtdsError as error:
        print(f"bench.ways: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
