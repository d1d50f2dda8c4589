"""The link through two Analog Discovery 2, against a fake of the vendor's library and a chip behind its serial port."""

import ctypes

import numpy as np
import pytest
from board import STATUS, T_SERIAL, V_SERIAL, FakeChip, ManualClock, build_fake, load_fake

from rtds_host.errors import InputError, LinkError
from rtds_host.link.ad2 import Ad2Link
from rtds_host.link.analog import Line, Paths
from rtds_host.link.calibrate import measure
from rtds_host.motor.parameters import PARAMETER_NAMES

MOTOR = dict(zip(PARAMETER_NAMES, (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)))
INTERVAL = 0.032
ZERO_V = 2.048


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return build_fake(tmp_path_factory.mktemp("dwf"))


@pytest.fixture
def dwf(monkeypatch, library):
    return load_fake(monkeypatch, library)


class Board:
    def __init__(self, dwf, wires=None, **options):
        self.dwf, self.clock, self.chip = dwf, ManualClock(), FakeChip(dwf, wires)
        self.link = Ad2Link((V_SERIAL, T_SERIAL), self.chip.client(), clock=self.clock, **options)
        self.link.set_parameters(**MOTOR)

    def exchange(self, volts=(3.0, -2.0), loads=(1e-4, -1e-4)):
        return self.link.exchange(volts, loads, INTERVAL, 0.001)


def test_voltages_and_torques_reach_the_pins_that_stand_for_them(dwf):
    board = Board(dwf)
    board.exchange((3.0, -2.0), (1e-4, -1e-4))
    expected = [
        ZERO_V + 3.0 / 7.8125,
        ZERO_V - 2.0 / 7.8125,
        2.048 + 1e-7 / 9.5367431640625e-07,
        2.048 - 1e-7 / 9.5367431640625e-07,
    ]
    assert board.chip.pins() == pytest.approx(expected, abs=1e-6)


def test_the_samples_are_what_the_dac_shows(dwf):
    board = Board(dwf)
    board.chip.show([2048 + 512, 2048 + 1000, 2048 - 256, 2048 - 300])
    got = board.exchange()
    assert got.t_s == pytest.approx(np.arange(1, 33) * 1e-3)
    # The PC's ADC has steps of 0.3 mV where the DAC's are 1.2: up to an eighth of a step off.
    assert got.currents[-1] == pytest.approx([0.5, -0.25], abs=0.13 / 1024)
    assert got.speeds[-1] == pytest.approx([1000.0, -300.0], abs=0.13)


@pytest.mark.parametrize("volts", [(40.0, -40.0), (1e30, -1e30)])
def test_no_voltage_leaves_the_range_of_the_adc(dwf, volts):
    # A calibration that asks for more must not get it either.
    board = Board(dwf, calibration=Paths(to_chip=(Line(0.6, 0.5), Line(0.6, 0.5), Line(), Line())))
    board.exchange(volts, (1.0, -1.0))
    outs = [dwf.fake_output(k, c) for k in range(2) for c in range(2)]
    assert all(0.0 <= v <= 4.095 for v in outs)
    assert {"v_l", "v_r", "t_l", "t_r"} <= board.link.front.clipped


def test_parameters_arrive_in_the_registers(dwf):
    board = Board(dwf)
    assert board.link.registers.read("R") == pytest.approx(8.6)
    flags = board.link.registers.flags("CONFIG")
    assert flags == {n: n in ("v_from_adc", "t_from_adc") for n in flags}


def test_a_step_that_the_board_does_not_make_is_refused(dwf):
    with pytest.raises(InputError, match="the board makes a step each 1e-05 s"):
        Board(dwf).link.set_parameters(**(MOTOR | {"step_s": 5e-6}))


class TestPacing:
    def test_exchanges_begin_one_interval_apart_whatever_the_host_does_in_between(self, dwf):
        board = Board(dwf)
        began = []
        for _ in range(5):
            board.exchange()
            began.append(board.clock.t - INTERVAL)
            board.clock.t += 0.004  # controller and robot
        assert np.diff(began) == pytest.approx([INTERVAL] * 4)

    def test_lateness_and_jitter_are_reported(self, dwf):
        board = Board(dwf)
        for late in (0.002, 0.004, 0.006, 0.0):
            board.exchange()
            board.clock.t += late
        report = board.link.report()
        assert report["exchanges"] == 3
        assert report["lateness_mean_s"] == pytest.approx(0.004)
        assert report["lateness_max_s"] == pytest.approx(0.006)
        assert report["jitter_s"] == pytest.approx(np.std([0.002, 0.004, 0.006]))
        assert report["overruns"] == 0

    def test_an_overrun_puts_the_voltages_to_zero_for_that_exchange_and_is_counted(self, dwf):
        board = Board(dwf)
        board.exchange()
        board.clock.t += 0.6 * INTERVAL
        board.exchange()
        assert board.chip.pins() == pytest.approx([ZERO_V] * 4)
        assert board.link.report()["overruns"] == 1
        board.exchange()
        assert board.chip.pins()[0] == pytest.approx(ZERO_V + 3.0 / 7.8125)

    def test_a_host_that_never_keeps_up_ends_the_run_at_zero(self, dwf):
        board = Board(dwf)
        board.exchange()
        with pytest.raises(LinkError, match="does not keep up, 3 exchanges in a row .* at zero"):
            for _ in range(3):
                board.clock.t += INTERVAL
                board.exchange()
        assert not dwf.fake_is_open(0) and not dwf.fake_is_open(1)

    def test_a_sample_whose_successor_is_due_already_repeats_the_last(self, dwf):
        board = Board(dwf)
        board.exchange()
        board.clock.delays = [
            0.0,
            0.0,
            0.0,
            0.0035,
        ]  # the wait for 4 ms ends at 7.5: 5 and 6 ms are over, 7 is taken late
        assert len(board.exchange().t_s) == 32
        assert board.link.report()["samples_held"] == 2


class TestFaults:
    def test_a_lost_device_leaves_the_other_at_zero_and_says_which(self, dwf):
        board = Board(dwf)
        board.exchange()
        seen = []
        dwf.fake_unplug(1)
        pair = board.link.both
        close = pair.close
        pair.close = lambda: (seen.append(dwf.fake_output(0, 0)), close())
        with pytest.raises(LinkError, match="device 2 \\(210321AAAA02\\) does not answer .*disconnected.* at zero"):
            board.exchange()
        assert seen[0] == pytest.approx(ZERO_V)
        assert board.chip.closed and not dwf.fake_is_open(0)

    @pytest.mark.parametrize("flag", ["nonfinite", "adc_silent", "lock_lost", "overrun"])
    def test_a_fault_of_the_chip_ends_the_run(self, dwf, flag):
        board = Board(dwf)
        board.exchange()
        board.chip.words["STATUS"] = STATUS[flag]
        board.clock.t += 0.0
        with pytest.raises(LinkError, match=f"status {flag}.* at zero"):
            for _ in range(40):
                board.exchange()

    def test_an_output_that_was_cut_is_named(self, dwf):
        board = Board(dwf)
        board.chip.words["STATUS"] = STATUS["sat_w_r"]
        board.exchange()
        assert board.link.report()["cut_by_range"] == ["w_r"]

    def test_outputs_go_off_when_the_devices_are_closed(self, dwf):
        Board(dwf)
        assert dwf.fake_on_close(0) == dwf.fake_on_close(1) == 2

    def test_without_the_vendors_library_one_line_says_so(self, monkeypatch):
        def missing(name):
            raise OSError(f"{name}: cannot open shared object file")

        monkeypatch.setattr(ctypes.cdll, "LoadLibrary", missing)
        with pytest.raises(LinkError, match="WaveForms runtime of Digilent cannot be loaded"):
            Ad2Link((V_SERIAL, T_SERIAL), "/dev/null")


class TestChoice:
    def test_the_end_of_a_serial_number_is_enough(self, dwf):
        Ad2Link(("aa01", "aa02"), FakeChip(dwf).client(), clock=ManualClock()).close()

    @pytest.mark.parametrize(
        ("numbers", "message"),
        [
            ((), "two different serial numbers"),
            (("AA01",), "two different serial numbers"),
            (("AA01", "aa01"), "two different serial numbers"),
        ],
    )
    def test_two_numbers_are_needed(self, dwf, numbers, message):
        with pytest.raises(InputError, match=message):
            Ad2Link(numbers, FakeChip(dwf).client())

    @pytest.mark.parametrize(
        ("numbers", "message"),
        [
            (("CC99", "AA02"), "no device has the serial number CC99 .connected: 210321AAAA01, "),
            (("AA01", "02"), "2 devices have the serial number 02"),
            (("AA01", "AAAA01"), "both serial numbers name the device 210321AAAA01"),
        ],
    )
    def test_a_number_that_does_not_name_one_device_is_refused(self, dwf, numbers, message):
        dwf.fake_reset(3)
        with pytest.raises(LinkError, match=message):
            Ad2Link(numbers, FakeChip(dwf).client())

    def test_a_device_in_use_is_refused(self, dwf):
        dwf.fake_use(0)
        with pytest.raises(LinkError, match="AAAA01 is in use"):
            Ad2Link((V_SERIAL, T_SERIAL), FakeChip(dwf).client())
        assert not dwf.fake_is_open(1)

    def test_the_serial_port_is_needed(self, dwf):
        with pytest.raises(InputError, match="serial port"):
            Ad2Link((V_SERIAL, T_SERIAL))


WIRES = Paths(
    to_chip=(Line(1.02, -0.03), Line(0.97, 0.015), Line(1.01, 0.02), Line(0.99, -0.01)),
    from_chip=(Line(0.98, 0.02), Line(1.03, -0.025), Line(1.015, 0.01), Line(0.995, -0.03)),
)


def test_calibration_finds_the_wires_and_puts_the_scalings_back(dwf):
    board = Board(dwf, WIRES)
    measured = measure(board.link, "ad2")
    for found, true in zip((*measured.paths.to_chip, *measured.paths.from_chip), (*WIRES.to_chip, *WIRES.from_chip)):
        assert found.gain == pytest.approx(true.gain, abs=2e-4)
        assert found.offset_v == pytest.approx(true.offset_v, abs=5e-4)
    assert board.link.registers.read("DAC_I_L_GAIN") == 1024.0
    assert board.link.registers.read("DAC_W_R_OFFSET") == 0.0


def test_swapped_wires_are_no_calibration(dwf):
    board = Board(dwf)
    pins = board.chip.pins
    board.chip.pins = lambda: pins()[[1, 0, 2, 3]]
    with pytest.raises(LinkError, match="to_chip.v_l"):
        measure(board.link, "ad2")


def test_a_wire_that_is_not_connected_is_no_calibration(dwf):
    board = Board(dwf)
    pins = board.chip.pins
    board.chip.pins = lambda: pins() * [1, 1, 0, 1]
    with pytest.raises(LinkError, match="to_chip.t_l.gain: .* not connected"):
        measure(board.link, "ad2")
