"""Effects on every link: the RTL gives the model's bytes, the chip gives them between its converters."""

import math

import numpy as np
import pytest

from rtds_host.errors import InputError, LinkError
from rtds_host.link import open_link
from rtds_host.link.chip import ChipLink
from rtds_host.link.quantised import QuantisedLink
from rtds_host.link.registers import OP_WRITE, SOF_REQUEST, RegisterClient, decode, encode_answer, load_map
from rtds_host.motor.effect_tables import tables_of
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects

PARAMETERS = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)
SPEEDS = np.linspace(0.0, 600.0, 61)
STRIBECK = Curve(tuple(SPEEDS), tuple(2e-5 + 3e-5 * np.exp(-((SPEEDS / 75.0) ** 2))))
ANGLES = np.linspace(0.0, 2.0 * math.pi, 64)
SINE = Curve(tuple(ANGLES), tuple(1e-5 * np.sin(ANGLES)))
OWN = MotorParameters(9.0, 1.1e-3, 6e-3, 6.2e-3, 2e-7, 5e-7)
LEFT = UnitEffects(
    motor=OWN, friction_forward=STRIBECK, friction_backward=STRIBECK, drop=Curve((0.0, 0.0), (-0.3, 0.3)),
    heat_rise_per_w=0.2, heat_tau_s=1e-2, ripple=SINE, ripple_periods_per_rad=0.3,
)  # fmt: skip
RIGHT = UnitEffects(
    command=Curve((-12.0, -0.3, 0.3, 12.0), (-11.7, 0.0, 0.0, 11.7)), limit_v=5.0, load_share=0.2,
    torque=Curve((-2000.0, 0.0, 2000.0), (-1e-4, 0.0, 3e-4)),
)  # fmt: skip
SUPPLY = SupplyEffects(voltage_v=12.0, source_resistance_ohm=1.0, decline_v_per_s=2.0, command_delay_s=3e-4)


def bytes_of(link, exchanges, interval_s=1e-3, sample_s=1e-4):
    got = [link.exchange((6.0 - k, -5.0 + 2.0 * k), (1e-4 * k, -1e-4), interval_s, sample_s) for k in range(exchanges)]
    return b"".join(part.speeds.tobytes() + part.currents.tobytes() for part in got)


@pytest.mark.parametrize("parameters_first", [True, False])
def test_the_rtl_gives_the_bytes_of_the_model(simulator, parameters_first):
    results = []
    exchanges = 6 if simulator == "verilator" else 1
    for kind, options in (("model", {}), ("rtl", {"sim": simulator})):
        with open_link(kind, **options) as link:
            if parameters_first:
                link.set_parameters(*PARAMETERS)
            link.set_effects(LEFT, RIGHT, SUPPLY)
            if not parameters_first:
                link.set_parameters(*PARAMETERS, "trapezoidal")
            results.append(bytes_of(link, exchanges, sample_s=1e-4))
    assert results[0] == results[1]


def test_a_motor_of_its_own_alone_leaves_the_effect_unit_off():
    results = []
    for kind in ("model", "rtl"):
        with open_link(kind) as link:
            link.set_effects(None, UnitEffects(motor=OWN), None)
            link.set_parameters(*PARAMETERS)
            results.append(bytes_of(link, 4))
            if kind == "rtl":
                assert link.clocks < 27 * 400 + 2000
    assert results[0] == results[1]


@pytest.mark.parametrize("kind", ["model", "rtl"])
def test_all_absent_changes_no_bit(kind):
    results = []
    for effects in ((), (UnitEffects(), None, SupplyEffects())):
        with open_link(kind) as link:
            link.set_parameters(*PARAMETERS)
            if effects:
                link.set_effects(*effects)
            results.append(bytes_of(link, 3))
    assert results[0] == results[1]


@pytest.mark.parametrize("kind", ["model", "rtl"])
def test_effects_that_came_too_late_are_refused_and_the_run_goes_on(kind):
    with open_link(kind) as link:
        link.set_parameters(*PARAMETERS)
        link.exchange((1.0, 1.0), (0.0, 0.0), 1e-3)
        with pytest.raises(InputError, match="before the first"):
            link.set_effects(LEFT, None, None)
        link.exchange((1.0, 1.0), (0.0, 0.0), 1e-3)


def test_the_chip_gives_the_model_between_its_converters():
    # No decline: the chip makes some steps between its clear and the first exchange, in which a battery would fall.
    supply = SupplyEffects(voltage_v=12.0, source_resistance_ohm=1.0, command_delay_s=3e-4)
    motor_alone = UnitEffects(motor=OWN, friction_forward=STRIBECK, friction_backward=STRIBECK)
    with ChipLink() as chip, QuantisedLink(open_link("model"), None, ("voltages", "torques", "outputs")) as model:
        for link in (chip, model):
            link.set_effects(motor_alone, RIGHT, supply)
            link.set_parameters(*PARAMETERS)
        model.exchange((0.0, 0.0), (0.0, 0.0), 1e-5)
        for v, t in ((6.0, 0.0), (-3.0, 1e-4), (0.2, -2e-4), (0.0, 0.0)):
            got, expected = (link.exchange((v, 2.0 - v), (t, 1e-4), 0.004, 1e-4) for link in (chip, model))
            assert np.array_equal(got.speeds, expected.speeds)
            assert np.array_equal(got.currents, expected.currents)
        # From the record in the 50 MHz domain to the LDAC edge: 4 clocks more than without effects.
        latency = chip.registers.read_word("LATENCY")
        assert (latency & 0xFFFF, latency >> 16) == (64, 64)


def test_a_motor_of_its_own_and_parameters_from_the_adc_do_not_go_together():
    with ChipLink(parameters="adc") as link:
        link.set_effects(UnitEffects(motor=OWN), None, None)
        with pytest.raises(InputError, match="from registers"):
            link.set_parameters(*PARAMETERS)


NAMES = {register.address: register.name for register in load_map().registers}


class Memory:
    """A transport to registers that keep FX words; some answers, or some requests, get lost."""

    def __init__(self, lose_answers=(), lose_requests=(), take=True):
        self.words, self.address, self.count = {}, 0, 0
        self.lose_answers, self.lose_requests, self.take = set(lose_answers), set(lose_requests), take
        self._answer = b""

    def send(self, data):
        tag, op, address, word = decode(data, SOF_REQUEST)
        self.count += 1
        self._answer = b""
        if self.count in self.lose_requests:
            return
        name = NAMES[address]
        if op == OP_WRITE and name == "FX_ADDRESS":
            self.address = word
        elif op == OP_WRITE and name == "FX_DATA" and self.take:
            self.words[self.address] = word
            self.address += 1
        if self.count not in self.lose_answers:
            self._answer = encode_answer(tag, 0, address, self.address if op != OP_WRITE else word)

    def receive(self, count):
        got, self._answer = self._answer[:count], self._answer[count:]
        return got

    def flush_input(self):
        self._answer = b""

    def close(self):
        pass


@pytest.mark.parametrize("lost", [{}, {"lose_answers": [3, 40]}, {"lose_requests": [5, 90]}, {"lose_answers": [2]}])
def test_words_arrive_where_they_belong_though_answers_and_requests_get_lost(lost):
    words = tables_of(LEFT, RIGHT, SUPPLY, PARAMETERS)
    memory = Memory(**lost)
    RegisterClient(memory).load_effects(words.writes())
    # A word that was written twice pushes the others up by one; what lies beyond the run is no cell in use.
    wanted = dict(words.writes())
    assert {address: memory.words[address] for address in wanted} == wanted


def test_a_chip_that_takes_no_words_ends_in_one_line():
    with pytest.raises(LinkError, match="words for the effect unit do not arrive"):
        RegisterClient(Memory(take=False)).load_effects([(0, 1), (1, 2)])
