"""Progress is counted in work: it grows while a search works, never falls, and says how much time is left at most."""

import io
import sys
from types import SimpleNamespace

import pytest
from diagnosis_cases import make_case
from rich.console import Console
from rich.progress import Progress, TextColumn

from rtds_host import bars
from rtds_host.bars import TimeLeft, stages, time_left, watched
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.effort import COUNTED, Effort, spend


@pytest.fixture
def told():
    return []


def effort_of(told, **most):
    return Effort(lambda stage, share: told.append((stage, share)), most)


def test_a_stage_moves_by_its_work_up_to_its_end(told):
    effort = effort_of(told, candidates=10.0)
    effort.say("replay", 0.05)
    effort.spend(100.0)  # a stage that is not counted
    effort.say("candidates", 0.1)
    for work in (2.5, 2.5, 50.0):
        effort.spend(work)
    effort.say("gap", 0.85)
    shares = [share for stage, share in told if stage == "candidates"]
    assert shares == pytest.approx([0.1, 0.25, 0.4, 0.7])
    assert effort.work == 155.0 and told[-1] == ("gap", 0.85)


def test_a_share_never_falls(told):
    effort = effort_of(told, candidates=1.0)
    effort.say("candidates", 0.1)
    effort.spend(0.9)
    effort.say("half 1/4", 0.0)
    assert told[-1][1] == pytest.approx(0.64)


def test_work_is_told_to_who_watches_and_to_nobody_else(told):
    effort = effort_of(told)
    spend(1.0)
    with effort.watched():
        spend(2.0)
    spend(4.0)
    assert effort.work == 2.0


def test_a_diagnosis_tells_of_its_search_by_its_work(told):
    case = make_case(lambda m: m.add("coulomb", 0.05), seconds=2)
    diagnose(case, quick=True, threads=1, progress=lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares) and shares[-1] == 1.0
    low, high = COUNTED["candidates"]
    searching = {share for stage, share in told if stage == "candidates"}
    assert len(searching) > 20 and min(searching) == low and max(searching) <= high
    assert {stage for stage, _ in told} <= set(bars.WORDS)


def test_the_time_left_is_what_the_work_left_takes_at_the_pace_so_far():
    assert time_left(0.4, 0.1, 30.0) == pytest.approx(60.0)
    assert time_left(0.4, 0.1, 1.0) is None and time_left(0.11, 0.1, 30.0) is None


def test_the_time_left_is_shown_as_the_most_that_it_can_be(monkeypatch):
    now = [0.0]
    # Of this module alone: the bar has a clock of its own.
    monkeypatch.setattr(bars, "time", SimpleNamespace(monotonic=lambda: now[0]))
    bar = Progress(TextColumn(""), console=Console(file=io.StringIO()))
    bar.add_task("", total=1.0)
    column = TimeLeft()
    assert column.render(bar.tasks[0]).plain == ""
    bar.update(0, completed=0.25)
    now[0] = 40.0
    assert column.render(bar.tasks[0]).plain == "at most 2:00 left"


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"), [(True, False, True), (True, True, False), (False, False, False)]
)
def test_progress_is_shown_on_a_terminal_unless_it_is_to_be_quiet(terminal, quiet, shown, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    assert watched(quiet) is shown
    with stages(quiet) as report:
        report("candidates", 0.5)
    out, err = capsys.readouterr()
    assert out == "" and (err == "") is not shown
