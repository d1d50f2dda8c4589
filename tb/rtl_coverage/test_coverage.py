"""The report of `make coverage` on counts made up here: what is added up, explained, and refused."""

from __future__ import annotations

import pytest
from rtl_coverage import coverage_report as coverage


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """A tree with one module of two instances, and its counts; gives (counts folder, writer of explanations)."""
    rtl, counts = tmp_path / "rtl", tmp_path / "counts"
    rtl.mkdir()
    counts.mkdir()
    (rtl / "one.v").write_text("module one;\n  if (go_i) begin\n  reg [1:0] q;\nendmodule\n")
    (rtl / "two.v").write_text("module two;\nendmodule\n")
    rows = [
        ("one.v", 2, "branch", "if", "top.a", 3), ("one.v", 2, "branch", "else", "top.a", 0),
        ("one.v", 3, "toggle", "q[0]:0->1", "top.a", 0), ("one.v", 3, "toggle", "q[0]:0->1", "top.b", 1),
        ("one.v", 3, "toggle", "q[0]:1->0", "top.a", 2), ("one.v", 3, "toggle", "q[1]:0->1", "top.a", 0),
        ("one.v", 3, "toggle", "q[1]:1->0", "top.a", 0), ("../tb/agent.v", 1, "line", "block", "top", 0),
    ]  # fmt: skip
    for part in (0, 1):  # two runs
        text = "# SystemC::Coverage-3\n"
        for file, line, kind, what, path, count in rows[part::2]:
            fields = {"f": str(rtl / file), "l": line, "n": 3, "t": kind, "page": "x", "o": what, "h": path}
            text += "C '" + "".join(f"\x01{key}\x02{value}" for key, value in fields.items()) + f"' {count}\n"
        (counts / f"{part}.dat").write_text(text)
    monkeypatch.setattr(coverage, "RTL", rtl)
    monkeypatch.setattr(coverage, "HERE", tmp_path)

    def explain(text):
        (tmp_path / "explained.toml").write_text(text)

    return counts, explain


WHOLE = '[[explained]]\nfile = "two.v"\nwhole = true\nwhy = "not built"\n'
BRANCH = '[[explained]]\nfile = "one.v"\nline = ["if (go_i)"]\nwhy = "never stops"\n'
TOGGLE = '[[explained]]\nfile = "one.v"\ntoggle = [\'q\\[1\\]\']\nwhy = "small numbers"\n'


def test_instances_and_runs_are_added_up_and_other_folders_left_out(bench):
    counts = coverage.read_counts(bench[0])
    assert {point.file for point in counts} == {"one.v"}
    reached = {point.what for point, count in counts.items() if count}
    assert reached == {"if", "q[0]:0->1", "q[0]:1->0"}


def test_a_full_list_of_reasons_passes(bench, capsys):
    bench[1](WHOLE + BRANCH + TOGGLE)
    assert coverage.report(coverage.read_counts(bench[0])) == 0
    printed = capsys.readouterr().out
    assert "| one.v                    |      0 of 0 |      1 of 2 |        2 of 4 |" in printed
    assert "one.v (2): small numbers" in printed


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BRANCH + TOGGLE, "no bench builds it, no reason given: two.v"),
        (WHOLE + TOGGLE, "not reached, no reason given: one.v:2: branch else   if (go_i) begin"),
        (WHOLE + BRANCH, "not reached, no reason given: one.v:3: toggle q[1]:0->1"),
        (WHOLE + BRANCH + TOGGLE.replace("q\\[1\\]", "q.*"), ""),
        (
            WHOLE + BRANCH + TOGGLE + TOGGLE.replace("q\\[1\\]", "q\\[0\\]"),
            "a reason for what is reached: one.v: q\\[0\\]",
        ),
        (WHOLE + WHOLE.replace("two", "one") + BRANCH + TOGGLE, "a reason for what is reached: one.v"),
    ],
)
def test_what_is_missing_or_too_much_is_named_and_fails(bench, capsys, text, said):
    bench[1](text)
    assert coverage.report(coverage.read_counts(bench[0])) == (1 if said else 0)
    assert said in capsys.readouterr().out
