"""Codes and quantities: exact at the codes, nearest between them, clamped beyond, safe for what is no number."""

from __future__ import annotations

import numpy as np
import pytest

from rtds_host.errors import InputError
from rtds_host.link.scaling import ADC_CHANNELS, DAC_OUTPUTS, AdcScale, DacScale, default_scaling, scaling_from

CODES = np.arange(4096)
SCALING = default_scaling()


@pytest.mark.parametrize("name", ADC_CHANNELS)
def test_every_adc_code_comes_back(name):
    channel = SCALING.channel(name)
    assert np.array_equal(channel.encode(channel.decode(CODES)), CODES)


@pytest.mark.parametrize("name", DAC_OUTPUTS)
def test_every_dac_code_comes_back(name):
    output = SCALING.output(name)
    code, saturated, nan = output.encode(output.decode(CODES))
    assert np.array_equal(code, CODES) and not saturated.any() and not nan.any()


def test_signed_quantities_are_zero_at_mid_scale_and_parameters_at_code_0():
    for name in ("v_l", "v_r", "t_l", "t_r"):
        assert SCALING.channel(name).decode(2048) == 0.0
    for name in ("b", "j", "km", "kb"):
        assert SCALING.channel(name).decode(0) == 0.0
    for name in DAC_OUTPUTS:
        assert SCALING.output(name).encode(0.0)[0] == 2048


def test_default_ranges_hold_the_default_robot():
    from rtds_host.contract import builtin_robot

    motor, supply = builtin_robot("burger").motor, builtin_robot("burger").supply_v
    stall, no_load = supply / motor.resistance_ohm, supply / motor.back_emf_constant_v_s_per_rad
    for limit, wanted in (
        (SCALING.channel("v_l").limits, supply),
        (SCALING.output("i_l").limits, stall),
        (SCALING.output("w_l").limits, no_load),
    ):
        assert limit[0] <= -wanted and limit[1] >= wanted
    assert SCALING.channel("j").limits[1] > 2 * motor.rotor_inertia_kg_m2
    assert SCALING.channel("b").limits[1] > 2 * motor.viscous_friction_nm_s_per_rad


def test_float32_rounding_is_after_the_product_and_after_the_sum():
    channel = AdcScale(np.float32(0.1), np.float32(0.3), signed=True)
    expected = [np.float32(np.float32(code - 2048) * np.float32(0.1)) + np.float32(0.3) for code in CODES]
    assert channel.decode(CODES).tobytes() == np.array(expected, dtype=np.float32).tobytes()
    fused = np.float32((CODES - 2048) * float(np.float32(0.1)) + float(np.float32(0.3)))
    assert (channel.decode(CODES) != fused).any(), "the test cannot tell the two apart"


def test_adc_clamps_and_the_pin_stays_in_range():
    channel = SCALING.channel("v_l")
    assert list(channel.encode([-100.0, 100.0])) == [0, 4095]
    assert list(channel.pin_volts([-100.0, 0.0, 100.0])) == [0.0, 2.048, 4.095]


def test_dac_saturates_with_a_flag():
    output = SCALING.output("i_l")
    low, high = output.limits
    values = [low, high, np.nextafter(low - 0.5 / 1024, -9.0), high + 0.6 / 1024, -np.inf, np.inf, 1e38]
    code, saturated, nan = output.encode(values)
    assert list(code) == [0, 4095, 0, 4095, 0, 4095, 4095]
    assert list(saturated) == [False, False, False, True, True, True, True]
    assert not nan.any()


def test_nan_becomes_mid_scale_with_both_flags():
    code, saturated, nan = SCALING.output("w_r").encode(np.nan)
    assert (int(code), bool(saturated), bool(nan)) == (2048, True, True)
    infinity_times_zero = DacScale(np.float32(0.0), np.float32(0.0)).encode(np.inf)
    assert [int(x) for x in infinity_times_zero] == [2048, 1, 1]


def test_halves_round_to_even():
    output = DacScale(np.float32(1.0), np.float32(0.0))
    assert list(output.encode([0.5, 1.5, 2.5, -0.5, -1.5])[0] - 2048) == [0, 2, 2, 0, -2]


def test_registers_hold_the_scalings():
    values = SCALING.register_values()
    assert len(values) == 24
    assert scaling_from(values.__getitem__) == SCALING


def test_a_zero_gain_is_refused_where_it_would_divide():
    with pytest.raises(InputError, match="gain 0.0"):
        AdcScale(np.float32(0.0), np.float32(0.0), True).encode(1.0)
    with pytest.raises(InputError, match="gain nan"):
        DacScale(np.float32("nan"), np.float32(0.0)).decode(1)
