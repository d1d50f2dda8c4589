"""The report: words, schema, and the page in a real headless browser."""

import io
import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from diagnosis_cases import example_details, example_diagnosis, example_of
from rich.console import Console
from selenium.webdriver import ActionChains, Keys

from rtds_host import __version__
from rtds_host.contract import Axis, Servo
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.report import print_summary, report_page, validate
from rtds_host.diagnosis.report.html import unplaced
from rtds_host.diagnosis.report.made import written
from rtds_host.diagnosis.report.words import percent_closed, verdict_sentence


@pytest.fixture(scope="module")
def details():
    return example_details()


# ---- diagnosis.json ------------------------------------------------------------------------------------------------


def test_the_contracts_example_is_valid():
    validate(example_diagnosis())


def _without(key):
    def edit(d):
        del d[key]

    return edit


def _with(**values):
    def edit(d):
        d.update(values)

    return edit


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (_without("gap"), "gap"),
        (_with(verdict="perhaps"), "verdict"),
        (_with(schema="rtds-diagnosis/1"), "schema"),
        (_with(extra=1), "extra"),
        (_with(located=[{"subsystem": "drivetrain", "share": 0.7}]), "located"),
        (_with(located=[{"subsystem": "motor", "share": 1.0}]), "located/0/subsystem"),
        (_with(effects=[]), "effects"),
        (_with(verdict="unknown"), "effects"),
        (_with(budget=[{"what": "tolerance", "share": 0.5}]), "budget"),
        (_with(budget=[{"what": "rest", "share": 1.0}]), "budget/0"),
        (_with(verdict="partial", next_experiment=None), "next_experiment"),
        (
            _with(indistinguishable=[[{"id": "spin_scrub", "side": "both"}, {"id": "gyro_gain", "side": "both"}]]),
            "indistinguishable",
        ),
        (_with(verdict="none"), "verdict"),
        (_with(alternatives=[{"effects": [], "probability": 0.4}]), "alternatives"),
        (
            _with(alternatives=[{"effects": [], "probability": 0.1}, {"effects": "unknown", "probability": 0.9}]),
            "alternatives",
        ),
        (_with(indistinguishable=[[{"id": "coulomb_friction", "side": "both"}]]), "indistinguishable/0"),
        (_with(nominal_fit={"left": {}}), "nominal_fit"),
    ],
)
def test_a_diagnosis_that_breaks_the_contract_is_refused_by_place(edit, place):
    diagnosis = example_diagnosis()
    edit(diagnosis)
    with pytest.raises(ValueError, match=re.escape(place)):
        validate(diagnosis)


def test_an_interval_may_be_null_for_not_pinned():
    diagnosis = example_diagnosis()
    diagnosis["effects"][0]["parameters"]["torque_nm"]["ci90"] = None
    validate(diagnosis)


# ---- the page as text ----------------------------------------------------------------------------------------------


def test_the_same_input_gives_the_same_bytes(details):
    first = report_page(example_diagnosis(), details)
    assert report_page(example_diagnosis(), replace(example_details(), seconds=17.0)) == first


def test_the_page_refers_to_nothing_outside_itself(details):
    text = report_page(example_diagnosis(), details)
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!data:|#)""", text)
    assert "http://" not in text and "https://" not in text


def test_the_page_is_small_enough_to_mail(details):
    assert len(report_page(example_diagnosis(), details)) < 3_000_000


def test_text_from_outside_cannot_become_markup(details):
    text = report_page(example_diagnosis(), details)
    assert "&lt;on other runs&gt;" in text and "<on other runs>" not in text


# Names as a recording of somebody else may carry them: runs, robot, case, channels.
HOSTILE = (
    "</script><script>window.owned=1</script>",
    "<!--<script>",
    "]]><svg/onload=window.owned=1>",
    '"><img src=x onerror=window.owned=1>',
    "' onclick='window.owned=1",
    "__proto__",
    "${window.owned=1}",
    "a&lt;b",
)


def hostile(details):
    """The details with hostile names wherever names come from outside, and a diagnosis to them."""
    names = dict(zip((run.name for run in details.case.runs), HOSTILE))
    runs = tuple(replace(run, name=names[run.name]) for run in details.case.runs)
    case = replace(details.case, name=HOSTILE[3], robot=replace(details.case.robot, name=HOSTILE[4]), runs=runs)
    first = next(iter(details.traces))
    traces = {names[run]: dict(channels) for run, channels in details.traces.items()}
    traces[names[first]].update({name: details.traces[first]["w_l"] for name in HOSTILE})
    diagnosis = example_diagnosis()
    diagnosis["held_out_runs"] = list(HOSTILE)
    gap = {"before": 14.2, "refit": 13.9, "after": 1.08}
    diagnosis["gap"]["channels"] = {name: gap for name in HOSTILE}
    return diagnosis, replace(
        details,
        case=case,
        traces=traces,
        gate=examine(case),
        notes=list(HOSTILE),
        run_gaps={name: gap for name in HOSTILE},
        regimes={name: gap for name in HOSTILE},
    )


def test_no_name_can_end_a_script_or_open_a_comment_in_it(details):
    text = report_page(*hostile(details))
    embedded = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    assert len(embedded) == 3 and not any("<" in data for data in embedded)
    traces, paths, diagnosis = map(json.loads, embedded)
    assert HOSTILE[0] in traces and HOSTILE[0] in paths["paths"] and set(HOSTILE) <= set(paths["channels"])
    assert diagnosis["held_out_runs"] == list(HOSTILE)


def test_escape_codes_in_names_do_not_reach_a_terminal(details):
    codes = "\x1b[2J\x1b]0;owned\x07\u202e\x9b31m\udcff"
    run = replace(
        details.case.runs[0],
        name=f"run{codes}",
        columns={**details.case.runs[0].columns, "w_l": np.zeros(len(details.case.runs[0].t))},
    )
    case = replace(details.case, name=f"case{codes}", runs=(run, *details.case.runs[1:]))
    console = Console(file=io.StringIO(), width=400, force_terminal=False)
    print_summary(console, example_diagnosis(), replace(details, case=case, gate=examine(case)))
    shown = console.file.getvalue()
    assert shown.isascii() or not any(ord(c) in range(0x7F, 0xA0) or c in "\u202e\udcff" for c in shown)
    assert "\x1b" not in shown and r"case\x1b[2J\x1b]0;owned\x07\u202e\x9b31m\udcff" in shown
    assert r"run\x1b[2J" in shown


def traces_of(text):
    """What the page draws: run -> channel -> lines."""
    return json.loads(re.search(r'id="traces">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.parametrize("start", [20_000.0, 1.7e9])
def test_times_are_shown_from_the_runs_start_whatever_the_logs_clock(details, start):
    later = replace(
        details,
        case=replace(details.case, runs=tuple(replace(run, t=start + run.t) for run in details.case.runs)),
        traces={
            run: {name: replace(trace, t=start + trace.t) for name, trace in channels.items()}
            for run, channels in details.traces.items()
        },
    )
    text = report_page(example_diagnosis(), later)
    assert traces_of(text) == traces_of(report_page(example_diagnosis(), details))
    for trace in (trace for channels in traces_of(text).values() for trace in channels.values()):
        assert 0.0 <= trace["t"][0] < 0.05 and np.all(np.diff(trace["t"]) > 0.009) and len(trace["t"]) > 500
    # Where the gate's times lie.
    assert f'data-h="starts at t">{start:.0f} s<' in text and "time from the run's start" in text


VERDICTS = ("known", "partial", "unknown", "none")


def words_of(html):
    """What a piece of a page says."""
    return " ".join(
        unescape(re.sub(r"<style.*?</style>|<script.*?</script>|<[^>]+>", " ", html, flags=re.DOTALL)).split()
    )


def sections(verdict, details, **changes):
    """The sections of the report of a verdict, as HTML."""
    diagnosis = example_of(verdict)
    diagnosis.update(changes)
    validate(diagnosis)
    return re.findall(r"<section .*?</section>", report_page(diagnosis, details), re.DOTALL)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_its_page_and_summary(details, verdict):
    first, do = map(words_of, sections(verdict, details)[:2])
    console = Console(file=io.StringIO(), width=100)
    print_summary(console, example_of(verdict), details)
    shown = " ".join(console.file.getvalue().split())
    assert verdict in shown and verdict in first
    headline, step, summary = {
        "known": (
            "Coulomb friction (both sides) makes this robot differ",
            "If this shows it: grease or change the gear",
            "0.048 N·m",
        ),
        "partial": (
            "explains a part of the difference",
            "40 % of the difference is unmodelled; most of it shows in the wheel and ground",
            "40 % of it is unmodelled, most of that in the wheel and ground",
        ),
        "unknown": (
            "no effect of the catalogue explains it. Most of the difference shows in the drivetrain",
            "Change nothing on the robot yet",
            "unmodelled, drivetrain 90 %",
        ),
        "none": ("Nothing is missing", "Use the simulator as it is", "Nothing is missing"),
    }[verdict]
    assert headline in first and step in do and summary in shown
    assert ("Record the manoeuvre crawl next" in do) == (verdict != "none")


@pytest.mark.parametrize(
    ("verdict", "export", "close"),
    [("known", True, True), ("partial", True, True), ("unknown", False, False), ("none", True, False)],
)
def test_the_advice_names_the_commands_of_the_next_step(details, verdict, export, close):
    do = words_of(sections(verdict, details)[1])
    assert ("rtds export diagnosis.json" in do, "rtds close CASE" in do) == (export, close)
    assert "rtds plan diagnosis.json --robot robot.toml" in do
    assert ("--samples N" in do) == (verdict in ("known", "partial"))


def test_no_command_is_advised_that_would_refuse_the_robot(details):
    def on(robot):
        return " ".join(map(words_of, sections("known", replace(details, case=replace(details.case, robot=robot)))))

    robot = details.case.robot
    by_speed = on(replace(robot, driver=replace(robot.driver, mode="speed"), servo=Servo(0.44, 8.6, 12.0, 0.001)))
    assert (
        "rtds export" in by_speed
        and "rtds plan" in by_speed
        and "rtds close" not in by_speed
        and "--effects" not in by_speed
    )
    for other in (
        replace(robot, driver=replace(robot.driver, mode="torque", torque_nm_per_v=0.1)),
        replace(robot, chassis=None, axis=Axis("inertia", 1e-5)),
    ):
        text = on(other)
        assert "rtds predict RUN" in text
        assert not any(name in text for name in ("rtds export", "rtds plan", "rtds close", "rtds run"))


@pytest.mark.parametrize(
    ("held", "page_says", "terminal_says"),
    [
        (
            ["steps"],
            (
                "Each half of the run is judged with motor values and sizes worked out without it; the causes were"
                " chosen with the whole run."
            ),
            "the gap on held-out halves of the run falls",
        ),
        (
            ["spin", "steps"],
            (
                "Each run is judged with motor values and sizes worked out without it; the causes were chosen with"
                " all runs together."
            ),
            "the gap on held-out runs falls",
        ),
    ],
)
def test_what_the_gap_was_judged_on_is_said(details, held, page_says, terminal_says):
    assert page_says in words_of(sections("known", details, held_out_runs=held)[0])
    assert terminal_says in verdict_sentence({**example_diagnosis(), "held_out_runs": held})


# What a reader would have to have heard a lecture on statistics for.
STATISTICS = re.compile(
    r"probab|likelihood|posterior|prior\b|\bodds\b|sigma|standard"
    r" (deviation|error)|varian|confiden|interval|percentile|quantile|"
    r"significan|regress|correlat|covarian|residual|root"
    r" mean|\brms\b|held.out|\bfit(s|ted)?\b|refit|Shapley|bayes|evidence|"
    r"hypothes|estimat|distribut|null\b|\bbias(ed)?\b|\bmean\b|median",
    re.IGNORECASE,
)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_first_sections_need_no_statistics(details, verdict):
    for section in sections(verdict, details)[:2]:
        assert STATISTICS.findall(words_of(section)) == []


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_first_picture_is_what_the_gap_is_made_of(details, verdict):
    first = sections(verdict, details)[0]
    drawn = re.findall(r'data-what="(\w+)" data-share="([^"]+)".*?width="([^"]+)%"', first)
    rows = example_of(verdict)["budget"]
    assert [(what, float(share)) for what, share, _ in drawn] == [(row["what"], row["share"]) for row in rows]
    assert [float(width) / 100.0 for *_, width in drawn] == pytest.approx([row["share"] for row in rows], abs=1e-4)
    assert re.findall(r"<(?:svg|canvas)[^>]*", first)[:1] == (re.findall(r'<svg id="budget"[^>]*', first))
    assert all(text.strip() in first for text in re.findall(r'aria-label="shares of the difference: ([^;"]*)', first))
    unmodelled = sum(row["share"] for row in rows if row["what"] == "rest")
    assert verdict != "partial" or f"{100 * unmodelled:.0f} % of the difference is unmodelled" in words_of(
        sections(verdict, details)[1]
    )
    assert ("url(#unmodelled)" in first) == any(row["what"] == "rest" for row in rows)


@pytest.mark.parametrize("verdict", ["unknown", "none"])
def test_nothing_is_shown_with_effects_where_none_is_blamed(details, verdict):
    text = report_page(example_of(verdict), details)
    page = words_of(text)
    for words in ("with the named effects", "with the included effects", "with effects", "is closed"):
        assert words not in page
    traces = traces_of(text)
    assert {line for channels in traces.values() for trace in channels.values() for line in trace} == {
        "unit",
        "noise",
        "t",
        "measured",
        "nominal",
        "refit",
    }
    console = Console(file=io.StringIO(), width=100)
    print_summary(console, example_of(verdict), details)
    assert "with effects" not in console.file.getvalue() and "closed" not in console.file.getvalue()


def test_causes_that_look_alike_are_checked_and_none_of_them_is_mended(details):
    resistance, gain = {"id": "rolling_resistance", "side": "both"}, {"id": "speed_gain", "side": "both"}
    effect = {
        **resistance,
        "subsystem": "wheel_ground",
        "probability": 0.97,
        "gap_without": 13.9,
        "parameters": {"coefficient": {"value": 0.02, "ci90": [0.01, 0.03]}},
    }
    budget = [{"what": "effect", **resistance, "share": 0.95}, {"what": "rest", "subsystem": None, "share": 0.05}]
    alone = words_of(sections("known", details, effects=[effect], budget=budget)[1])
    assert "If this shows it: inflate" in alone and CATALOGUE["rolling_resistance"].check in alone
    alike = sections("known", details, effects=[effect], budget=budget, indistinguishable=[[resistance, gain]])
    do, everything = words_of(alike[1]), words_of(" ".join(alike))
    assert "rolling resistance or speed gain (both sides) would look the same in these runs" in do
    assert "Rolling resistance or speed gain (both sides) makes this robot differ" in everything
    assert (
        "These runs cannot tell which." in everything
        and "certain" not in everything
        and "ikely" not in words_of(alike[0])
    )
    for one in (resistance, gain):
        assert CATALOGUE[one["id"]].check in do and CATALOGUE[one["id"]].advice not in everything
    assert "nflate" not in everything
    assert "trust it for driving like these runs" in do and "trust it" not in alone
    assert "looks the same here: speed gain (both sides)" in words_of(alike[0])
    assert "97 % shared with speed gain (both sides)" in everything


def test_a_block_as_good_as_a_perfect_one_has_hardly_a_bar(details):
    blocks = re.search(r'<table id="blocks">.*?</table>', sections("known", details)[2], re.DOTALL)[0]
    width = {
        float(score): int(wide)
        for wide, score in re.findall(r'width:(\d+)px"></span><span class="value">([\d.]+)', blocks)
    }
    assert max(width.values()) == 120 == width[max(width)] and all(
        wide <= 2 for score, wide in width.items() if score < 1.05
    )


def test_each_effect_has_a_check_of_its_own():
    checks = {effect.check for effect in CATALOGUE.values()}
    assert len(checks) == len(CATALOGUE) and all(check.endswith(".") and len(check) > 30 for check in checks)
    for effect in CATALOGUE.values():
        assert all(other in CATALOGUE for other in effect.confused_with) and effect.check != effect.advice


def test_a_factor_is_shown_as_the_value_it_makes_with_nominal_and_unit(details):
    effect = {
        "id": "resistance_error",
        "side": "both",
        "subsystem": "winding",
        "probability": 0.8,
        "gap_without": 13.9,
        "parameters": {"ratio": {"value": 0.8, "ci90": [0.79, 0.81]}},
    }
    first, _, _, causes = sections("known", details, effects=[effect])[:4]
    assert "resistance error (both sides) : winding resistance 6.88 Ω in place of 8.6 Ω · likely" in words_of(first)
    row = re.search(r'<tr class="effect".*?</tr>', causes, re.DOTALL)[0]
    cells = dict(re.findall(r'data-h="([^"]+)">(.*?)</td>', row))
    assert [cells[h] for h in ("nominal", "fitted", "unit", "90 % interval")] == ["8.6", "6.88", "Ω", "6.794 to 6.966"]
    refitted = re.search(r'id="nominal_fit".*?</table>', causes, re.DOTALL)[0]
    assert "left winding resistance resistance_ohm 8.6 8.66 Ω" in words_of(refitted)


def test_the_channel_that_decided_is_named(details):
    causes = words_of(sections("known", details)[3])
    assert "channel that decided" in causes and "left wheel speed (w_l): 19.8 without it, 1.05 with it" in causes


def test_the_summary_names_effect_value_gap_and_next_run(details):
    console = Console(file=io.StringIO(), width=120)
    print_summary(console, example_diagnosis(), details)
    shown = console.file.getvalue()
    for piece in (
        "Coulomb friction, both sides",
        "0.048 N·m (0.046 to 0.05)",
        "14.2",
        "1.08",
        "record crawl (rtds plan",
    ):
        assert piece in shown
    assert len(shown.splitlines()) < 20


# ---- several causes, scatter, forms --------------------------------------------------------------------------------


def account():
    """The contract's example of section 5: two causes and a form next to a rest."""
    diagnosis = example_of("partial")
    coulomb, delay = {"id": "coulomb_friction", "side": "both"}, {"id": "command_delay", "side": "both"}
    gain = {"id": "driver_gain", "side": "both"}
    diagnosis["schema"] = "rtds-diagnosis/3"
    diagnosis["effects"] = [
        {**diagnosis["effects"][0], "scatter": 0.08, "scatters_with": None},
        {
            **delay,
            "subsystem": "timing",
            "probability": 0.93,
            "parameters": {"seconds": {"value": 0.031, "ci90": [0.026, 0.037]}},
            "gap_without": 6.8,
            "scatter": 0.31,
            "scatters_with": "speed",
        },
        {
            **gain,
            "subsystem": "driver",
            "probability": 0.6,
            "parameters": {"ratio": {"value": 0.9, "ci90": None}},
            "gap_without": 9.5,
        },
    ]
    diagnosis["indistinguishable"] = [[gain, {"id": "speed_gain", "side": "both"}]]
    form = {"term": "torque", "side": "both", "over": "yaw_rate"}
    diagnosis["forms"] = [
        {
            **form,
            "units": ["rad/s", "N·m"],
            "curve": [
                [-2.0, -0.061, 0.008],
                [-1.0, -0.017, 0.004],
                [0.0, 0.0, 0.003],
                [1.0, 0.016, 0.004],
                [2.0, 0.063, 0.008],
            ],
            "formula": "-a·x·|x|",
            "parameters": {"a": {"value": 0.0156, "ci90": [0.0131, 0.0182]}},
            "closes": 0.71,
        }
    ]
    diagnosis["budget"] = [
        {"what": "effect", **coulomb, "share": 0.45},
        {"what": "effect", **delay, "share": 0.13},
        {"what": "effect", **gain, "share": 0.02},
        {"what": "tolerance", "share": 0.02},
        {"what": "form", **form, "share": 0.24},
        {"what": "rest", "subsystem": "wheel_ground", "share": 0.14},
    ]
    diagnosis["gap"]["with_forms"] = 3.2
    validate(diagnosis)
    return diagnosis


def test_several_causes_are_a_list_with_size_share_and_look_alikes_a_line(details):
    first = words_of(report_page(account(), details).split("</section>")[0])
    assert "3 causes explain a part of the difference between simulator and robot." in first
    for line in (
        "Coulomb friction (both sides) : 0.048 N·m · 45 % of the difference · very likely · size varies by 8 % between "
        "settings",
        "command delay : 0.031 s · 13 % of the difference · very likely · size varies by 31 % with speed",
        "driver gain (both sides) : 0.9 times · 2 % of the difference · looks the same here: speed gain (both sides)",
        "Unmodelled term, free curve : torque over yaw rate, both sides : -a·x·|x| · 24 % of the difference",
    ):
        assert line.replace(" , ", ", ") in first.replace(" , ", ", ")
    assert STATISTICS.findall(first) == []


def test_repeatability_is_shown_where_the_diagnosis_has_it(details):
    repeats = {("command_delay", "both"): (7, 8)}
    text = words_of(report_page(account(), replace(details, repeats=repeats)))
    assert "found on 7 of 8 halves of the data" in text
    assert "halves of the data" not in words_of(report_page(account(), details))


def test_a_form_is_drawn_with_band_density_formula_and_what_to_look_for(details):
    text = report_page(account(), details)
    shape = re.search(r'<section id="forms".*?</section>', text, re.DOTALL)[0]
    assert shape.count("<circle") == 5 and 'class="band"' in shape and shape.count('class="data"') > 3
    said = words_of(shape)
    for words in ("Torque over yaw rate, both sides", "closes 71 %", "-a·x·|x|", "0.0156 (0.0131 to 0.0182, 90 %)"):
        assert words in said
    assert CATALOGUE["spin_scrub"].check in said and "With effects and free curves the gap is 3.2" in said
    assert 'aria-label="torque over yaw rate, both sides: from -0.061 at -2' in shape
    assert 'id="forms"' not in report_page(example_diagnosis(), details)


def test_an_older_diagnosis_without_the_new_keys_is_valid_and_shown(details):
    for schema in ("rtds-diagnosis/2", "rtds-diagnosis/3"):
        diagnosis = {**example_diagnosis(), "schema": schema}
        validate(diagnosis)
        assert "size varies" not in report_page(diagnosis, details)


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda d: d["forms"][0].pop("closes"), "forms/0"),
        (lambda d: d["forms"][0]["curve"].append([0.0, 1.0]), "forms/0/curve/5"),
        (lambda d: d["forms"][0].update(side="front"), "forms/0/side"),
        (lambda d: d["forms"][0]["curve"].reverse(), "forms/0/curve"),
        (lambda d: d["budget"][4].pop("over"), "budget/4"),
        (lambda d: d["effects"][0].update(scatter=-0.1), "effects/0/scatter"),
        (lambda d: d["gap"].update(with_forms=-1.0), "gap/with_forms"),
        (lambda d: d["gap"].update(with_forms=None), "gap/with_forms"),
    ],
)
def test_a_form_that_breaks_the_contract_is_refused_by_place(edit, place):
    diagnosis = account()
    edit(diagnosis)
    with pytest.raises(ValueError, match=re.escape(place)):
        validate(diagnosis)


# ---- a report that is written --------------------------------------------------------------------------------------


def test_a_written_report_names_program_date_and_the_very_command(details, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1795744800")
    case, out = tmp_path / "my case", tmp_path / "out"
    text = written(report_page(example_diagnosis(), details), case, out, quick=True)
    said = words_of(re.search(r'<footer id="made".*?</footer>', text, re.DOTALL)[0])
    assert f"Made by rtds {__version__}" in said and "on 2026-11-27 02:00 UTC with" in said
    assert f"rtds diagnose '{case}' --out {out} --quick" in said
    do = words_of(re.search(r'<ol id="do">.*?</ol>', text, re.DOTALL)[0])
    assert f"rtds export {out}/diagnosis.json --robot '{case}/robot.toml' --to sdf" in do
    assert f"rtds close '{case}' --diagnosis {out}/diagnosis.json" in do
    # Without its place and date it is the same text again.
    assert unplaced(text) == report_page(example_diagnosis(), details)


# ---- the page in a browser -----------------------------------------------------------------------------------------


@pytest.fixture
def opened(browser, details, tmp_path):
    """The example's report, opened again for each test: others leave the browser on pages of their own."""
    path = tmp_path / "report.html"
    path.write_text(report_page(example_diagnosis(), details), encoding="utf-8")
    browser.get_log("performance")
    browser.get(path.as_uri())
    return browser


@pytest.mark.browser
def test_hostile_names_are_shown_and_do_nothing(browser, details, tmp_path):
    diagnosis, marked = hostile(details)
    (tmp_path / "report.html").write_text(report_page(diagnosis, marked), encoding="utf-8")
    browser.get_log("browser")
    browser.get((tmp_path / "report.html").as_uri())
    assert [entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    assert browser.execute_script("return typeof window.owned") == "undefined"
    assert len(browser.find_elements("css selector", "script")) == 4
    assert browser.find_elements("css selector", "img, [onclick], [onload], [onerror]") == []
    held = json.loads(browser.execute_script("return document.getElementById('diagnosis').textContent"))
    assert held == diagnosis
    assert HOSTILE[3] in browser.find_element("css selector", "h1").text
    runs = [option.get_attribute("value") for option in browser.find_elements("css selector", "#run option")]
    assert runs == list(HOSTILE[:3])
    drawn = browser.find_elements("css selector", "#plots canvas")
    assert {c.get_attribute("data-channel") for c in drawn} >= {"w_l", *HOSTILE}


PIXELS = """
const c = arguments[0], d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = new Set();
for (let k = 0; k < d.length; k += 4) if (d[k + 3] > 200) seen.add(d[k] + ',' + d[k + 1] + ',' + d[k + 2]);
return [...seen];
"""


@pytest.mark.browser
def test_the_page_loads_without_errors_and_without_network(opened):
    assert [entry for entry in opened.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    asked = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [m["params"] for m in asked if m["method"] == "Network.requestWillBeSent"]
    # The browser's own start page may still be loading; what counts is what the report asks for.
    urls = [p["request"]["url"] for p in sent if p["documentURL"] == opened.current_url]
    assert opened.current_url in urls
    assert [url for url in urls if not url.startswith(("file:", "data:"))] == []


@pytest.mark.browser
def test_the_text_on_the_page_matches_the_json(opened):
    held = json.loads(opened.execute_script("return document.getElementById('diagnosis').textContent"))
    assert held == example_diagnosis()
    verdict = opened.find_element("id", "verdict").text
    for piece in ("known", "Coulomb friction (both sides)"):
        assert piece in verdict
    assert opened.find_element("id", "named").text == (
        "Coulomb friction (both sides): 0.048 N·m · 95 % of the difference · very likely"
    )
    figures = {f.get_attribute("data-name"): f.text for f in opened.find_elements("css selector", "#gap > div")}
    assert figures["before"].startswith("14.2") and figures["after"].startswith("1.08")
    closed = opened.find_element("id", "closed").text
    assert closed.startswith("99.4 %") and "99.1 % to 99.7 %" in closed
    shares = {
        g.get_attribute("data-subsystem"): float(g.get_attribute("data-share"))
        for g in opened.find_elements("css selector", "#chain .block")
    }
    assert shares["drivetrain"] == 0.91 and shares["driver"] == 0.09 and len(shares) == 7
    rows = opened.find_elements("css selector", "#alternatives tbody tr")
    assert [float(r.get_attribute("data-probability")) for r in rows] == [0.95, 0.03, 0.01, 0.01]
    assert "misses the runs with payload" in rows[1].text
    assert "0.046 to 0.05" in opened.find_element("css selector", "#effects tr.effect").text
    assert "w_l" in opened.find_element("id", "channels").text
    assert "crawl" in opened.find_element("id", "next").text


@pytest.mark.browser
def test_each_channel_has_a_plot_with_measured_nominal_and_after(opened):
    canvases = opened.find_elements("css selector", "#plots canvas")
    assert {c.get_attribute("data-channel") for c in canvases} >= {"w_l", "w_r", "i_l", "gyro_z", "yaw"}
    chosen = next(c for c in canvases if c.get_attribute("data-channel") == "w_l")
    colours = opened.execute_script(PIXELS, chosen)
    nominal, after, band = "213,94,0", "0,114,178", "228,233,238"
    assert {nominal, after} <= set(colours) and band not in colours
    missed = next(c for c in canvases if c.get_attribute("data-missed") == "w_l")
    assert {nominal, after, band} <= set(opened.execute_script(PIXELS, missed))
    # Next to the trace, at the same height.
    assert missed.rect["y"] == chosen.rect["y"] and missed.rect["x"] > chosen.rect["x"] + chosen.rect["width"]


@pytest.mark.browser
def test_each_line_has_a_dash_pattern_of_its_own(opened):
    patterns = opened.execute_script("""
        return [...document.querySelectorAll('#keys path')].map(p => {
            const s = getComputedStyle(p); return [s.stroke, s.strokeDasharray, s.strokeWidth]; });""")
    assert len(patterns) == 4
    assert len({colour for colour, *_ in patterns}) == 4 and len({(dash, width) for _, dash, width in patterns}) == 4


# Elements that leave the page to the right, and texts whose contrast is below what WCAG 2.1 (1.4.3) asks for.
OVERFLOWS = """
const wide = document.documentElement.clientWidth, found = [];
if (document.documentElement.scrollWidth > wide) found.push('page ' + document.documentElement.scrollWidth);
for (const e of document.querySelectorAll('body *')) {
  const box = e.getBoundingClientRect();
  if (box.width && box.height && (box.right > wide + 0.5 || box.left < -0.5))
    found.push(e.tagName + ' ' + e.className + ' ' + box.right);
  if (e.clientWidth && e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== 'visible')
    found.push('cut ' + e.tagName);
}
return found;
"""
FAINT = """
const context = document.createElement('canvas').getContext('2d', {willReadFrequently: true});
const parse = (text) => {
  context.clearRect(0, 0, 1, 1); context.fillStyle = text; context.fillRect(0, 0, 1, 1);
  const [r, g, b, a] = context.getImageData(0, 0, 1, 1).data; return [r, g, b, a / 255]; };
const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
  .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
  .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
const found = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
let seen = 0;
while (walker.nextNode()) {
  const e = walker.currentNode.parentElement;
  if (!walker.currentNode.textContent.trim() || !e.getClientRects().length
    || ['SCRIPT', 'STYLE', 'OPTION'].includes(e.tagName))
    continue;
  seen += 1;
  const style = getComputedStyle(e), inside = e.tagName.toLowerCase() === 'text';
  const ink = parse(inside ? style.fill : style.color);
  let ground = inside && style.stroke !== 'none' ? parse(style.stroke) : [0, 0, 0, 0];
  for (let up = e; ground[3] < 1 && up; up = up.parentElement) {
    const next = parse(getComputedStyle(up).backgroundColor);
    if (next[3] > 0) ground = next;
  }
  const [a, b] = [light(ink), light(ground)].sort((x, y) => y - x);
  const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
  const ratio = (a + 0.05) / (b + 0.05);
  if (ratio < (large ? 3 : 4.5) || size < 12)
    found.push([ratio.toFixed(2), style.fontSize, e.textContent.trim().slice(0, 40)]);
}
return [seen, found];
"""


def emulate(browser, width=1200, height=1400, media="", scheme="light"):
    """Give the browser's page a size, a medium and a colour scheme."""
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"media": media, "features": [{"name": "prefers-color-scheme", "value": scheme}]}
    )


@pytest.fixture
def page(browser, details, tmp_path):
    """Open the report of a verdict in a window of a size and a colour scheme."""

    def show(verdict, width=1200, height=1400, **media):
        emulate(browser, width, height, **media)
        (tmp_path / "report.html").write_text(report_page(example_of(verdict), details), encoding="utf-8")
        browser.get((tmp_path / "report.html").as_uri())
        return browser

    yield show
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 768, 1280])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_nothing_overflows_and_everything_can_be_read(page, verdict, width, scheme):
    browser = page(verdict, width, 844, scheme=scheme)
    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    assert browser.execute_script(OVERFLOWS) == []
    seen, faint = browser.execute_script(FAINT)
    assert seen > 100 and faint == []


@pytest.mark.browser
def test_on_a_dark_screen_page_and_plots_are_dark(page):
    browser = page("known", scheme="dark")
    ground = "return getComputedStyle(document.querySelector('section')).backgroundColor"
    line = "86,180,233"
    canvas = browser.find_element("css selector", "#plots canvas[data-channel=w_l]")
    assert browser.execute_script(ground) == "rgb(26, 33, 41)" and line in browser.execute_script(PIXELS, canvas)
    emulate(browser, scheme="light")
    assert browser.execute_script(ground) == "rgb(255, 255, 255)"
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    colours = browser.execute_script(PIXELS, canvas)
    assert line not in colours and "0,114,178" in colours


@pytest.mark.browser
def test_paper_is_white_whatever_the_screen(page):
    browser = page("partial", media="print", scheme="dark")
    assert browser.execute_script("return getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.execute_script(FAINT)[1] == []
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    canvas = browser.find_element("css selector", "#plots canvas[data-channel=w_l]")
    assert "0,114,178" in browser.execute_script(PIXELS, canvas)


@pytest.mark.browser
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_first_screen_needs_no_statistics_and_shows_the_bar(page, verdict, width, height):
    browser = page(verdict, width, height)
    shown = browser.execute_script("""
        const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
        while (walker.nextNode()) {
          const range = document.createRange(); range.selectNode(walker.currentNode);
          const box = range.getBoundingClientRect();
          if (box.height && box.top < window.innerHeight) found.push(walker.currentNode.textContent);
        }
        return found.join(' ');""")
    assert example_of(verdict)["verdict"] in shown and STATISTICS.findall(shown) == []
    bars = browser.find_elements("id", "budget")
    assert len(bars) == (verdict != "none")
    assert all(bar.rect["y"] + bar.rect["height"] < height / 2 for bar in bars)


# A wheel's turn over the middle of the first channel's plot; says whether the page kept it from scrolling.
WHEEL = """
const c = document.querySelector('#plots canvas[data-channel]'), b = c.getBoundingClientRect();
return !c.dispatchEvent(new WheelEvent('wheel', {deltaY: -800, ctrlKey: arguments[0], clientX: b.left + b.width / 2,
                                                 clientY: b.top + 50, bubbles: true, cancelable: true}));
"""
SHOT = "return document.querySelector('#plots canvas[data-channel]').toDataURL()"


@pytest.mark.browser
def test_the_wheel_scrolls_the_page_and_with_control_zooms_all_plots(opened):
    before = opened.execute_script(SHOT)
    assert not opened.execute_script(WHEEL, False) and opened.execute_script(SHOT) == before
    assert opened.execute_script(WHEEL, True) and opened.execute_script(SHOT) != before
    opened.execute_script("document.getElementById('reset').click()")
    assert opened.execute_script(SHOT) == before


@pytest.mark.browser
def test_buttons_and_keys_zoom_and_read_values_without_a_mouse(opened):
    before = opened.execute_script(SHOT)
    opened.find_element("id", "closer").click()
    assert opened.execute_script(SHOT) != before
    chosen = opened.find_element("css selector", "#plots canvas[data-channel=w_l]")
    chosen.send_keys("0")
    assert opened.execute_script(SHOT) == before
    chosen.send_keys(Keys.HOME + Keys.ARROW_RIGHT * 3)
    told = opened.find_element("id", "readout").get_attribute("textContent")
    assert re.fullmatch(r"0\.\d{3} s: measured \S+, with effects \S+, nominal \S+ rad/s", told)
    assert opened.find_element("css selector", "figure:has([data-channel=w_l]) .tip").text == told
    chosen.send_keys(Keys.ESCAPE)
    assert not opened.find_element("css selector", "figure:has([data-channel=w_l]) .tip").is_displayed()


@pytest.mark.browser
def test_a_mouse_over_a_plot_reads_values_and_a_drag_zooms(opened):
    chosen = opened.find_element("css selector", "#plots canvas[data-channel=gyro_z]")
    opened.execute_script("arguments[0].scrollIntoView({block: 'center'})", chosen)
    before = opened.execute_script(SHOT)
    ActionChains(opened).move_to_element(chosen).perform()
    tip = opened.find_element("css selector", "figure:has([data-channel=gyro_z]) .tip")
    assert "measured" in tip.text and tip.text.endswith("rad/s")
    ActionChains(opened).click_and_hold().move_by_offset(90, 0).release().perform()
    assert opened.execute_script(SHOT) != before
    ActionChains(opened).double_click(chosen).perform()
    assert opened.execute_script(SHOT) == before


@pytest.mark.browser
def test_channels_stand_in_order_of_misfit_and_each_plot_says_what_it_shows(opened):
    canvases = opened.find_elements("css selector", "#plots canvas")
    assert canvases[0].get_attribute("data-path") == "1" and canvases[1].get_attribute("data-channel") == "w_l"
    labels = [c.get_attribute("aria-label") for c in canvases]
    assert labels[0].startswith("Way over the floor, run spin: measured x")
    assert (
        labels[1].startswith("left wheel speed (w_l), run spin, rad/s: measured ") and "gap 20.1 nominal" in labels[1]
    )
    bus = opened.find_element("css selector", "figure:has([data-channel=v_bus]) figcaption").text
    assert "does not count in the gap: the bus voltage never does" in bus
    assert "left wheel angle (th_l): does not count in the gap" in opened.find_element("id", "uncounted").text


@pytest.mark.browser
def test_another_run_and_another_line_can_be_shown(opened):
    shot = "return document.querySelector('#plots canvas[data-channel=w_l]').toDataURL()"
    first = opened.execute_script(shot)
    opened.execute_script(
        "const s = document.getElementById('run'); s.value = 'weave'; s.dispatchEvent(new Event('change'))"
    )
    second = opened.execute_script(shot)
    assert second != first
    opened.execute_script("document.querySelector('#keys input[value=nominal]').click()")
    assert opened.execute_script(shot) != second


@pytest.mark.parametrize(("closed", "said"), [(1.06, "100 %"), (0.931, "93 %"), (-0.2, "-20 %"), (None, "–")])
def test_of_a_gap_no_more_is_closed_than_all(closed, said):
    assert percent_closed(closed) == said
