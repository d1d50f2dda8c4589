"""A page that shows another answer than the program gives is caught, and one that shows the same is let through."""

import copy
import json

import pytest
import run_tutorial
from page_answers import compare_output, compare_prose, read_answers
from test_docs_commands import blocks

KNOWN = {
    "schema": "rtds-diagnosis/1", "verdict": "known",
    "effects": [{"id": "coulomb_friction", "side": "left", "subsystem": "drivetrain", "probability": 0.98,
                 "parameters": {"torque_nm": {"value": 0.1202, "ci90": [0.1180, 0.1224]}}}],
    "gap": {"before": 13.8, "refit": 11.5, "after": 1.03, "closed": 0.998, "effect_closed": 0.997},
    "located": [{"subsystem": "drivetrain", "share": 0.97}, {"subsystem": "chassis", "share": 0.03}],
    "budget": [{"what": "effect", "id": "coulomb_friction", "side": "left", "share": 0.99},
               {"what": "rest", "subsystem": None, "share": 0.01}],
    "alternatives": [{"effects": [{"id": "coulomb_friction", "side": "left"}], "probability": 0.98},
                     {"effects": [{"id": "driver_deadzone", "side": "left"}], "probability": 0.01},
                     {"effects": "unknown", "probability": 0.01}],
    "next_experiment": {"scenario": "spin", "why": "it would tell Coulomb friction, left side from spin scrub"},
}  # fmt: skip
HEADLINE = (
    "rover known  Coulomb friction, left side (0.1202 N·m): 98 % probable. With motor values\n"
    "refitted, the gap on held-out runs falls from 11.5 to 1.03 times the sensors' noise\n"
    "(99.7 % closed; nominal 13.8).\n"
)
WHOLE = (
    HEADLINE
    + """  located  drivetrain 97 %, chassis 3 %
  made of  Coulomb friction, left side 99 %
  effect   Coulomb friction, left side: torque_nm = 0.1202 N·m (0.118 to 0.1224)
  odds     Coulomb friction, left side 98 %; driver dead zone, left side 1 %; none of the catalogue 1 %
  gap       nominal  refitted  with effects  closed
  held out     13.8      11.5          1.03  99.7 %
  next     record spin (rtds plan gives its commands): it would tell Coulomb friction,
left side from spin scrub
  6.1 s
"""
)
# Two effects and a rest without a name, in the second schema: what was added there must not disturb.
PARTIAL = {
    "schema": "rtds-diagnosis/2", "verdict": "partial",
    "effects": [
        {"id": "coulomb_friction", "side": "both", "subsystem": "drivetrain", "probability": 0.99, "gap_without": 9.4,
         "parameters": {"torque_nm": {"value": 0.048, "ci90": [0.042, 0.054]}}},
        {"id": "command_delay", "side": "both", "subsystem": "timing", "probability": 0.93, "gap_without": 6.8,
         "parameters": {"seconds": {"value": 0.031, "ci90": None}}},
    ],
    "budget": [{"what": "effect", "id": "coulomb_friction", "side": "both", "share": 0.52}],
    "gap": {"before": 14.2, "refit": 14.0, "after": 6.1, "closed": 0.61, "effect_closed": 0.61,
            "rest": {"share": 0.39, "structured": True, "subsystem": "wheel_ground"}},
}  # fmt: skip
PARTIAL_PAGE = """truck partial  Coulomb friction, both sides (0.05 N·m); command delay (0.03 s): 93 % probable. With
motor values refitted, the gap on held-out runs falls from 14.0 to 6.1 times the sensors' noise (61 % closed; nominal
14.2).
"""
UNKNOWN = {
    "schema": "rtds-diagnosis/1",
    "verdict": "unknown",
    "effects": [],
    "gap": {"before": 13.8, "refit": 11.5, "after": 11.5, "closed": 0.18, "effect_closed": 0.0},
}
UNKNOWN_TERMINAL = "rover unknown  Something that the catalogue does not hold makes the gap.\n"


def complaints(said, now, tmp_path, printed=None):
    """What is wrong with a page that shows `said` below a diagnosis that answers `now`."""
    (tmp_path / "report").mkdir(exist_ok=True)
    (tmp_path / "report" / "diagnosis.json").write_text(json.dumps(now))
    return compare_output("rtds diagnose rover --out report", said, said if printed is None else printed, tmp_path)


def changed(now, path, value):
    """A copy of a diagnosis with one entry changed."""
    now = copy.deepcopy(now)
    holder = now
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    return now


@pytest.mark.parametrize(("said", "now"), [(HEADLINE, KNOWN), (WHOLE, KNOWN), (PARTIAL_PAGE, PARTIAL)])
def test_the_answer_that_is_given_is_let_through(said, now, tmp_path):
    assert complaints(said, now, tmp_path) == []


def test_a_page_that_promises_a_cause_where_the_program_knows_none_is_caught(tmp_path):
    assert complaints(HEADLINE, UNKNOWN, tmp_path, UNKNOWN_TERMINAL)[:2] == [
        "rover: verdict known, now unknown",
        "rover: effect coulomb_friction left, now not included",
    ]


TORQUE = ("effects", 0, "parameters", "torque_nm")


@pytest.mark.parametrize(("path", "value", "complaint"), [
    (("verdict",), "partial", "verdict known, now partial"),
    (("effects", 0, "side"), "right", "effect coulomb_friction left, now not included"),
    (("effects", 0, "id"), "driver_deadzone", "effect driver_deadzone left not there, now included"),
    ((*TORQUE, "ci90"), [0.1210, 0.1230], "coulomb_friction left torque_nm = 0.1202, now 0.1202 in [0.121, 0.123]"),
    (("gap", "refit"), 13.0, "gap refit 11.5, now 13.0"),
    (("gap", "after"), 1.2, "gap after 1.03, now 1.2"),
    (("gap", "effect_closed"), 0.8, "effect_closed 0.997, now 0.8"),
    (("effects", 0, "probability"), 0.7, "probability 0.98, now 0.7"),
    (("located", 0, "subsystem"), "winding", "located: drivetrain 0.97, now 0"),
    (("located", 0, "subsystem"), "winding", "located: winding 0, now 0.97"),
    (("located", 1, "share"), 0.3, "located: chassis 0.03, now 0.3"),
    (("budget", 0, "side"), "right", "made of: Coulomb friction, left side 0.99, now 0"),
    (("budget", 1, "share"), 0.4, "made of: unmodelled, place not known 0, now 0.4"),
    (("alternatives", 0, "probability"), 0.8, "odds: Coulomb friction, left side 0.98, now 0.8"),
    (("alternatives", 2, "probability"), 0.3, "odds: none of the catalogue 0.01, now 0.3"),
    (("next_experiment", "scenario"), "circle", "next: 'record spin: it would tell Coulomb friction, left side from "
     "spin scrub', now 'record circle: it would tell Coulomb friction, left side from spin scrub'"),
    (("next_experiment", "why"), "for fun", "next: 'record spin: it would tell Coulomb friction, left side from spin "
     "scrub', now 'record spin: for fun'"),
])  # fmt: skip
def test_each_part_of_an_answer_is_compared(path, value, complaint, tmp_path):
    assert f"rover: {complaint}" in complaints(WHOLE, changed(KNOWN, path, value), tmp_path)


@pytest.mark.parametrize(("path", "value"), [
    ((*TORQUE,), {"value": 0.1210, "ci90": [0.1190, 0.1230]}),
    (("gap", "refit"), 12.0),
    (("gap", "after"), 1.07),
    (("effects", 0, "probability"), 0.93),
    (("located", 0, "share"), 0.9),
    (("alternatives", 1, "effects", 0, "id"), "spin_scrub"),
])  # fmt: skip
def test_what_another_compiler_or_machine_moves_is_let_through(path, value, tmp_path):
    assert complaints(WHOLE, changed(KNOWN, path, value), tmp_path) == []


def test_an_indistinguishable_effect_is_not_taken_for_an_included_one(tmp_path):
    said = HEADLINE.rstrip() + " These runs cannot distinguish it from driver dead zone (left side).\n"
    assert complaints(said, KNOWN, tmp_path) == []


def test_an_effect_that_the_page_leaves_out_is_missed(tmp_path):
    said = PARTIAL_PAGE.replace("; command delay (0.03 s)", "")
    assert complaints(said, PARTIAL, tmp_path) == ["truck: effect command_delay both not there, now included"]


def test_a_size_without_an_interval_is_compared_to_ten_per_cent(tmp_path):
    said = PARTIAL_PAGE.replace("0.03 s", "0.04 s")
    assert complaints(said, PARTIAL, tmp_path) == ["truck: command_delay both seconds = 0.04, now 0.031 in None"]


def test_many_cases_are_compared_each_with_its_own_file(tmp_path):
    for name, now in (("rover", KNOWN), ("truck", PARTIAL)):
        (tmp_path / "out" / name).mkdir(parents=True)
        (tmp_path / "out" / name / "diagnosis.json").write_text(json.dumps(now))
    said = HEADLINE + PARTIAL_PAGE
    assert compare_output("rtds diagnose rover truck --out out", said, said, tmp_path) == []
    swapped = said.replace("rover known", "truck known").replace("truck partial", "rover partial")
    assert "truck: verdict known, now partial" in compare_output(
        "rtds diagnose rover truck --out out", swapped, said, tmp_path
    )


def test_a_page_without_an_answer_where_one_is_printed_is_caught(tmp_path):
    assert complaints("it went well\n", KNOWN, tmp_path, WHOLE) == ["no answer below the command"]
    assert complaints(HEADLINE, KNOWN, tmp_path, "done\n") == ["rover: the terminal shows no such answer"]


def test_json_on_a_page_is_compared_by_its_keys(tmp_path):
    def shown(diagnosis):
        return f"known\n{json.dumps(diagnosis['effects'], indent=1)}\ngap {json.dumps(diagnosis['gap'])}\n"

    def against(now):
        return compare_output("python -c show", shown(KNOWN), shown(now), tmp_path)

    assert against(KNOWN) == []
    assert against(changed(KNOWN, (*TORQUE, "value"), 0.1210)) == []
    assert against(changed(KNOWN, (*TORQUE,), {"value": 0.13, "ci90": [0.125, 0.135]})) == [
        "JSON.0.0.parameters.torque_nm = 0.1202, now 0.13 in [0.125, 0.135]"
    ]
    assert against(changed(KNOWN, ("effects", 0, "side"), "right")) == ["JSON.0.0.side: 'left', now 'right'"]
    assert against(changed(KNOWN, ("gap", "refit"), 13.0)) == ["JSON.1.refit: 11.5, now 13"]
    assert against(changed(KNOWN, ("gap", "rest"), 0.1)) == ["JSON.1: rest is new"]


def test_the_table_of_close_is_compared_with_its_file(tmp_path):
    table = (
        "  gap                       nominal  corrected  closed\n  in the simulator             13.8       1.03  99.8"
        " %\n  in the diagnosis' replay     13.8       1.03  99.8 %\n"
    )
    (tmp_path / "closed").mkdir()
    for after, closed, complaint in (
        (1.06, 0.99, []),
        (11.5, 0.18, ["in the simulator: gap after 1.03, now 11.5", "in the simulator: closed 0.998, now 0.18"]),
    ):
        gap = {
            "simulator": {"before": 13.8, "after": after, "closed": closed},
            "replay": {"before": 13.8, "after": 1.03, "closed": 0.998},
        }
        (tmp_path / "closed" / "close.json").write_text(json.dumps({"gap": gap}))
        assert compare_output("rtds close rover --out closed", table, "", tmp_path) == complaint


def test_other_output_must_be_printed_as_it_stands_though_lines_may_be_left_out(tmp_path):
    printed = "case/square: speed mode, 635 rows\ncase/spin: speed mode, 776 rows\ncase/wander: speed mode, 712 rows\n"
    said = "case/square:   speed mode, 635 rows\ncase/wander: speed mode, 712 rows\n"
    assert compare_output("rtds import x", said, printed, tmp_path) == []
    assert compare_output("rtds import x", said.replace("712", "711"), printed, tmp_path) == [
        "'case/wander: speed mode, 711 rows' is not printed"
    ]


def test_marked_figures_and_words_in_sentences_are_compared(tmp_path):
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "diagnosis.json").write_text(json.dumps(KNOWN))
    mark = "<!-- answer: report/diagnosis.json {} -->"
    page = (
        f"It is `known`{mark.format('verdict')}, on the left{mark.format('effects.0.side')} side, "
        f"of **0.1202**{mark.format('effects.0.parameters.torque_nm.value')} N·m; the gap falls from "
        f"11.5{mark.format('gap.refit')} by 99.7 %{mark.format('gap.effect_closed')}."
    )
    assert compare_prose(page, tmp_path) == []
    for old, new, complaint in (
        ("`known`", "`unknown`", "verdict: unknown, now known"),
        ("left<", "right<", "effects.0.side: right, now left"),
        ("0.1202", "0.13", "effects.0.parameters.torque_nm.value = 0.13, now 0.1202 in [0.118, 0.1224]"),
        ("11.5", "14.5", "gap.refit: 14.5, now 11.5"),
        ("99.7 %", "80 %", "gap.effect_closed: 0.8, now 0.997"),
        ("gap.refit", "gap.refitted", "11.5: report/diagnosis.json has no gap.refitted"),
    ):
        assert compare_prose(page.replace(old, new), tmp_path) == [complaint]


def test_what_stands_below_a_command_belongs_to_it(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        f"```sh\ncp a b\nrtds diagnose rover --out report\n```\n\n```text\n{HEADLINE}```\n"
        f"```console\n$ ls\nout\n$ rtds diagnose rover --out report\n{WHOLE}```\n"
    )
    first, second = blocks(page)
    assert first.said == ("", HEADLINE.rstrip("\n"))
    assert second.said == ("out", WHOLE.rstrip("\n"))
    assert [a.effects for said in (first.said[1], second.said[1]) for a in read_answers(said)] == [
        {("coulomb_friction", "left"): {0: 0.1202}},
        {("coulomb_friction", "left"): {"torque_nm": 0.1202}},
    ]


def test_an_answer_that_no_command_gives_is_caught(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"```sh\nls\n```\n\nAnother time:\n\n```text\n{HEADLINE}```\n")
    with pytest.raises(AssertionError, match="an answer that no command gives"):
        blocks(page)


def test_a_page_is_brought_up_to_date_where_it_shows_an_answer(tmp_path):
    mark = "<!-- answer: report/diagnosis.json gap.refit -->"
    page = tmp_path / "page.md"
    page.write_text(f"""The gap falls from 9.9{mark}.

```sh
mkdir report
echo '{json.dumps(KNOWN)}' > report/diagnosis.json
cat examples/said.txt
```

```text
{HEADLINE.replace("0.1202", "0.3")}```

```sh
printf 'wall time 3.5 s\\nspeed 12 rad/s\\n'
```

```text
speed 9 rad/s
```

```console
$ echo new
old
```
""")
    (tmp_path / "said.txt").write_text(WHOLE)
    text = run_tutorial.refreshed(page.read_text().replace("examples/said.txt", str(tmp_path / "said.txt")))
    assert f"falls from 11{mark}" in text or f"falls from 12{mark}" in text
    assert f"```text\n{HEADLINE}```" in text
    assert "```text\nspeed 12 rad/s\n```" in text
    assert text.endswith("```console\n$ echo new\nnew\n```\n")


EXPORTED = (
    "burger.xml: burger-nominal for mjcf\n  own       coulomb_friction (left) torque_nm = 0.119\nin MuJoCo, from the"
    " files  5.73  1.09  0.980\n"
)


@pytest.mark.parametrize(
    ("old", "new", "wrong"),
    [
        ("0.119", "0.11901", False),
        ("1.09", "1.12", False),
        ("1.09", "1.31", True),
        ("coulomb_friction", "driver_deadzone", True),
        ("(left)", "(both)", True),
    ],
)
def test_what_an_export_prints_may_differ_by_a_tenth_of_a_figure_and_no_word(tmp_path, old, new, wrong):
    command = "rtds export report/diagnosis.json --robot robot.toml --to mjcf --out burger.xml"
    assert bool(compare_output(command, EXPORTED, EXPORTED.replace(old, new), tmp_path)) == wrong


def test_a_replay_that_is_closer_than_the_noise_closes_all_of_a_gap_and_no_more(tmp_path):
    """`effect_closed` of such a diagnosis is above 1, and the sentence says 100 %."""
    page = HEADLINE.replace("99.7 % closed;", "100 % closed;")
    assert complaints(page, changed(KNOWN, ("gap", "effect_closed"), 1.1), tmp_path) == []
    assert complaints(page, changed(KNOWN, ("gap", "effect_closed"), 0.8), tmp_path) == [
        "rover: effect_closed 1, now 0.8"
    ]
