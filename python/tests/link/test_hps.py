"""The hps link's host side against the RTL behind a simulated bus, and what it does when that answers oddly."""

import dataclasses
import os
import signal
import time

import numpy as np
import pytest
from link_cases import BURGER, STEP_S

from rtds_host.bench import hps as bench
from rtds_host.errors import InputError, LinkError
from rtds_host.link import hps, open_link
from rtds_host.link.hps import READ, UNTIL_ZERO, WRITE, HpsLink, MemoryBus, SimulatedBus
from rtds_host.motor.effects import Curve, SupplyEffects, UnitEffects
from rtds_host.run.loop import drive
from rtds_host.run.plan import make_plan


def assert_same(got, want):
    assert got.t_s.tobytes() == want.t_s.tobytes()
    assert got.speeds.tobytes() == want.speeds.tobytes()
    assert got.currents.tobytes() == want.currents.tobytes()


@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("stalls", [None, "3"])
def test_exchanges_over_the_bus_are_byte_equal_to_the_model(effects, stalls):
    """With a master that is late at each handshake, too."""
    rng = np.random.default_rng(5)
    environment = {} if stalls is None else {"RTDS_HPS_STALLS": stalls}
    with HpsLink(SimulatedBus(environment=environment), step_clocks="min") as link, open_link("model") as model:
        for one in (link, model):
            if effects:
                level = Curve((0.0, 0.0), (1e-4, 1e-4))
                dry = UnitEffects(friction_forward=level, friction_backward=level)
                one.set_effects(dry, None, SupplyEffects(voltage_v=12.0, command_delay_s=3e-4))
            one.set_parameters(**BURGER)
        for steps, every in ((1, None), (5, 2), (320, 10), (33, 1), (100, 7), (65, 64), (700, 100)):
            call = rng.uniform(-12, 12, 2), rng.uniform(-1e-3, 1e-3, 2), steps * STEP_S, every and every * STEP_S
            assert_same(link.exchange(*call), model.exchange(*call))
        assert link.report()["steps"] == 1 + 5 + 320 + 33 + 100 + 65 + 700


@pytest.mark.long
@pytest.mark.parametrize("scenario", ["linear", "circle", "eight"])
def test_a_whole_scenario_over_the_bus_is_byte_equal_to_the_model(scenario):
    compare_runs(make_plan(scenario))


@pytest.mark.parametrize("scenario", ["linear", "circle", "eight"])
def test_a_scenarios_first_second_over_the_bus_is_byte_equal_to_the_model(scenario):
    compare_runs(dataclasses.replace(make_plan(scenario), total_steps=1000))


def compare_runs(plan):
    records = []
    for link in (HpsLink(SimulatedBus(), step_clocks="min"), open_link("model")):
        with link:
            records.append(drive(plan, link))
    for name in ("speeds", "currents", "applied", "shaft_torques"):
        assert getattr(records[0], name).tobytes() == getattr(records[1], name).tobytes(), name


def test_a_step_is_as_long_as_real_time_has_it_and_what_comes_late_is_counted():
    with HpsLink(SimulatedBus()) as link:
        link.set_parameters(**BURGER)
        link.exchange([6.0, 6.0], [0.0, 0.0], 20 * STEP_S)
        assert link.delayed_clocks == 0
        before = link.bus.run([(READ, link.offsets["CLOCKS"], 0)])[0]
        link.bus.run([(2, 0, 5000)])  # the host is away for ten steps
        link.exchange([6.0, 6.0], [0.0, 0.0], 20 * STEP_S)
        after = link.bus.run([(READ, link.offsets["CLOCKS"], 0)])[0]
    assert after - before >= 20 * 500
    assert 4500 < link.delayed_clocks < 5500


@pytest.mark.parametrize(("samples", "reads", "clocks"), [(1, 7, 62), (10, 43, 242)])
def test_an_exchange_of_a_millisecond_takes_so_many_clocks_of_the_bus(samples, reads, clocks):
    """What docs/hps-link.md states; without the wait for the motors."""
    assert bench.on_the_bus(samples) == bench.Accesses(writes=6, reads=reads, clocks=clocks)


@pytest.mark.parametrize(("samples", "reads"), [(1, 7), (10, 43)])
def test_the_benchs_file_of_registers_sees_the_accesses_that_the_bus_sees(samples, reads):
    """So the exchanges a second that the bench times are those whose clocks are counted."""
    counted, rate = bench.of_the_host(samples, 0.0)
    assert counted == bench.Accesses(writes=6, reads=reads, clocks=0)
    assert rate > 0.0


def test_the_bench_of_the_bridge_prints_accesses_clocks_and_what_is_left(capsys, monkeypatch):
    monkeypatch.setattr(bench, "of_the_host", lambda samples, seconds: (bench.Accesses(6, 7, 0), 50_000.0))
    bench.run(0.0)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["1", "6", "7", "62", "0.12%", "50000", "20.0", "50"] in lines
    assert ["10", "6", "43", "242", "0.48%", "50000", "20.0", "50"] in lines


def test_what_the_registers_refuse_ends_in_one_line():
    with HpsLink(SimulatedBus()) as link:
        for order in ((WRITE, link.offsets["IDENTITY"], 1), (READ, 0x0F0, 0), (READ, 0x1000, 0), (WRITE, 0x0F0, 1)):
            with pytest.raises(LinkError, match="hps bus: (read of|write to) 0x[0-9a-f]+ was refused"):
                link.bus.run([order])
        link.bus.run([(WRITE, link.offsets["INPUTS"], 7)])
        link.bus.run([(WRITE, link.offsets["STEP_CLOCKS"], 500), (WRITE, link.offsets["GO"], 3)])
        with pytest.raises(LinkError, match="write to 0x040 was refused"):  # a request is under way
            link.bus.run([(WRITE, link.offsets["INPUTS"], 8)])
        link.bus.run([(UNTIL_ZERO, link.offsets["STATUS"], hps.BUSY)])
        assert link.bus.run([(READ, link.offsets["INPUTS"], 0)]) == [7]


def test_a_simulator_that_is_killed_ends_in_one_line():
    with HpsLink(SimulatedBus()) as link:
        link.set_parameters(**BURGER)
        os.kill(link.bus.pid, signal.SIGKILL)
        with pytest.raises(LinkError, match=r"hps simulator \(process \d+\): it was killed by SIGKILL"):
            link.exchange([1.0, 1.0], [0.0, 0.0], STEP_S)


class Registers(MemoryBus):
    """The board's bus over a file in place of the memory device."""

    def __init__(self, path, words):
        path.write_bytes(np.asarray(words, "<u4").tobytes().ljust(hps.SIZE, b"\0"))
        super().__init__(os.fspath(path), base=0, timeout_s=0.05)


def test_the_boards_bus_reads_and_writes_words_and_gives_up_in_time(tmp_path):
    bus = Registers(tmp_path / "mem", [1, 2, 3])
    assert bus.run([(READ, 8, 0), (WRITE, 4, 0xFFFF_FFFE), (READ, 4, 0), (UNTIL_ZERO, 8, 4)]) == [3, 0, 0xFFFF_FFFE, 3]
    began = time.monotonic()
    with pytest.raises(LinkError, match="register 0x8 kept 0x3"):
        bus.run([(UNTIL_ZERO, 8, 1)])
    assert time.monotonic() - began >= 0.05
    bus.close()


def test_another_design_behind_the_bridge_is_refused(tmp_path):
    with pytest.raises(LinkError, match="another design is in the FPGA"):
        HpsLink(Registers(tmp_path / "mem", [0x1234, 1]))


def test_without_the_memory_device_the_line_says_where_the_link_runs(tmp_path):
    with pytest.raises(LinkError, match="cannot open .* link hps runs as root on the board"):
        MemoryBus(os.fspath(tmp_path / "none"))


@pytest.mark.parametrize("wrong", ["most", 0, 65536])
def test_a_period_that_cannot_be_is_refused(wrong):
    with pytest.raises(InputError, match="step_clocks"):
        HpsLink(step_clocks=wrong)
