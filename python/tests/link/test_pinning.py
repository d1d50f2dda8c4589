"""The header of an evaluation a phase: which phases are compiled together, and what is a pin."""

import re

import pytest

from rtds_host.errors import LinkError
from rtds_host.link import pinning
from rtds_host.link.tops import Top

TOP = Top(
    module="t",
    file_lists=(),
    sources=(),
    clocks=(("clk_i", 1),),
    posedge_only=True,
    sync="sync_o",
    control="",
    bridge="",
    phases=("slot_q", "strobe"),
    still=(("go_i", "go_q"), ("gone_i", "gone_q")),
)
HEADER = """
    VL_IN8(clk_i,0,0);
    CData/*1:0*/ t__DOT__slot_q;
    CData/*0:0*/ t__DOT__strobe;
    CData/*0:0*/ go_i;
    CData/*0:0*/ t__DOT__go_i;
    CData/*0:0*/ t__DOT__go_q;
    CData/*0:0*/ t__DOT__busy_q;
    CData/*0:0*/ t__DOT__data_q;
"""
# Phases 4 (the strobe), 1, 2, 3 of 100 clocks each, and 0, which follows itself.
FOLLOWS = {0: 0, 1: 2, 2: 3, 3: 4, 4: 1}
PROFILE = "".join(
    f"phase {phase} next {after}\nt__DOT__go_q 1 100 100\n"
    f"t__DOT__busy_q {int(phase > 0)} 97 100\nt__DOT__data_q 0 95 100\n"
    for phase, after in FOLLOWS.items()
)


def test_a_step_is_cut_into_a_short_chain_and_long_ones_and_other_phases_are_alone():
    step = [200, *range(1, 30)]
    follows = {phase: after for phase, after in zip(step, [*step[1:], 200], strict=True)} | {0: 0, 50: 1}
    found = pinning.chains(follows)
    assert [phase for chain in found[:-2] for phase in chain] == step
    assert [len(chain) for chain in found] == [2, 12, 12, 4, 1, 1]
    assert sorted(chain[0] for chain in found[-2:]) == [0, 50]


def test_a_step_that_does_not_come_back_to_its_strobe_is_cut_where_it_is_known():
    assert pinning.chains({4: 1, 1: 2}) == [[4, 1]]
    assert pinning.chains({}) == []


def test_the_header_has_the_pins_of_each_phase_and_the_chains():
    text = pinning.pinned_header(TOP, HEADER, PROFILE)
    assert "#define RTDS_PHASE_COUNT 8" in text
    assert "#define RTDS_CHAINS(C) C(4, 2, 2) C(2, 2, 4) C(0, 1, 0)\n" in text
    assert "#define RTDS_CHAIN_4(P) P(1)\n" in text and "#define RTDS_CHAIN_2(P) P(3)\n" in text
    assert re.findall(r"RTDS_PINS_(\d)\(IS\) (.*)\n", text) == [
        (str(phase), f"IS(t__DOT__busy_q, {int(phase > 0)})") for phase in range(5)
    ]


def test_what_is_equal_while_no_request_begins_is_no_pin_of_a_value():
    """Both copies of the port are held equal to the register, whatever its value. A missing port is left out."""
    text = pinning.pinned_header(TOP, HEADER, PROFILE)
    assert "#define RTDS_STILL(S) S(go_i, t__DOT__go_q) S(t__DOT__go_i, t__DOT__go_q)\n" in text
    assert "IS(t__DOT__go_q" not in text


def test_a_profile_of_other_lines_is_refused():
    with pytest.raises(LinkError, match="profile is not usable"):
        pinning.pinned_header(TOP, HEADER, "nonsense\n")
