"""The simulator's check mode finds a pinned evaluation that is not the RTL's: one is planted in a build."""

import dataclasses
import re

import pytest
from link_cases import BURGER, STEP_S

from rtds_host.errors import LinkError
from rtds_host.link import build, open_link, rtl
from rtds_host.link.rtl import RtlLink
from rtds_host.link.tops import ROOT, TOPS

PHASE = 9  # a clock in the middle of a step
MEMBER = "rtds_sim_top__DOT__u_core__DOT__g_side__BRA__0__KET____DOT__u_motor__DOT__u_electrical__DOT__hi_q"
PLANT = f"++clocks; if (phase == {PHASE}) root.{MEMBER} ^= 1u;"


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A top whose evaluation of one phase turns the last bit of a sum, built without optimisation."""
    main = tmp_path / "verilator_main.cpp"
    text = (ROOT / TOPS["core"].main).read_text()
    assert text.count("++clocks;") == 1
    main.write_text(text.replace("++clocks;", PLANT))

    def watched(top, step_clocks, environment):
        """The simulator that is watched has no chains: it is the sound one, which other tests have built."""
        return RtlLink(
            step_clocks=step_clocks, top=dataclasses.replace(top, main=TOPS["core"].main), environment=environment
        )

    monkeypatch.setattr(rtl, "watched_link", watched)
    monkeypatch.setattr(build, "CXX_FLAGS", "-O0 -ffp-contract=off")
    return dataclasses.replace(TOPS["core"], main=str(main))


def run(link):
    link.set_parameters(**BURGER)
    return link.exchange([6.0, -3.0], [1e-5, 2e-5], 50 * STEP_S, STEP_S)


def test_a_difference_planted_in_one_phase_is_named_by_the_check_and_by_it_alone(planted):
    with open_link("model") as model:
        want = run(model)
    with RtlLink(top=planted) as link:
        assert run(link).currents.tobytes() != want.currents.tobytes(), "the plant has to matter"
    with RtlLink(top=planted, environment={"RTDS_LOOP": "plain"}) as link:
        assert run(link).currents.tobytes() == want.currents.tobytes(), "and to be in the chains alone"
    with RtlLink(top=planted, environment={"RTDS_LOOP": "check"}) as link, pytest.raises(LinkError) as caught:
        run(link)
    said = str(caught.value)
    assert "it ended with exit status 3" in said
    found = re.search(r"the chain of phase (\d+), (\d+) clocks, differs from the general evaluation in byte \d+", said)
    assert found and int(found[1]) <= PHASE < int(found[1]) + int(found[2])
