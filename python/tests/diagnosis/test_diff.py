"""Two diagnoses compared: what came, what went, what changed its size, and what only changed its name."""

import json
import sys

import pytest
from diagnosis_cases import example_diagnosis, example_of

from rtds_host.cli.commands import main
from rtds_host.diagnosis.differ import compare, lines, page


def later(**torque):
    """The example of another day: friction of another size."""
    diagnosis = example_diagnosis()
    diagnosis["effects"][0]["parameters"]["torque_nm"].update(torque)
    return diagnosis


@pytest.mark.parametrize(
    ("torque", "change"),
    [
        ({"value": 0.049, "ci90": [0.047, 0.051]}, "same"),
        ({"value": 0.070, "ci90": [0.066, 0.074]}, "moved"),
        ({"value": 0.070, "ci90": None}, "same"),
    ],
)
def test_a_size_has_moved_where_the_intervals_share_no_value(torque, change):
    (cause,) = compare(example_diagnosis(), later(**torque))["causes"]
    assert cause["change"] == change


def test_what_came_and_what_went_is_said_and_a_mere_change_of_name_too():
    gone = compare(example_diagnosis(), example_of("unknown"))
    assert [c["change"] for c in gone["causes"]] == ["gone"] and gone["verdict"] == ["known", "unknown"]
    other = example_diagnosis()
    other["effects"][0].update(id="rolling_resistance", parameters={"coefficient": {"value": 0.02, "ci90": None}})
    coulomb, rolling = ({"id": name, "side": "both"} for name in ("coulomb_friction", "rolling_resistance"))
    other["indistinguishable"] = [[rolling, coulomb]]
    renamed = compare(example_diagnosis(), other)
    assert [(c["change"], c["alike"]) for c in renamed["causes"]] == [("gone", [rolling]), ("new", [coulomb])]
    assert any("what looks the same: rolling resistance" in line for line in lines(renamed, ("a", "b")))


def test_the_page_carries_everything_itself_and_no_markup_from_names():
    text = page(compare(example_diagnosis(), later(value=0.07, ci90=[0.066, 0.074])), ("<b>day one</b>", "day two"))
    assert "intervals apart" in text and "&lt;b&gt;day one" in text and "http://" not in text and "src=" not in text


def test_the_command_prints_words_or_json_and_writes_the_page(tmp_path, monkeypatch, capsys):
    for name, diagnosis in (("one", example_diagnosis()), ("two", later(value=0.07, ci90=[0.066, 0.074]))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "diagnosis.json").write_text(json.dumps(diagnosis))

    def said(*words):
        monkeypatch.setattr(sys, "argv", ["rtds", "diff", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, capsys.readouterr()

    status, shown = said(tmp_path / "one", tmp_path / "two" / "diagnosis.json", "--html", tmp_path / "diff.html")
    assert status == 0 and "Coulomb friction, both sides: another size" in shown.out
    assert "0.048 N·m (0.046 to 0.05) -> 0.07 N·m (0.066 to 0.074)  intervals apart" in shown.out
    assert (tmp_path / "diff.html").read_text().startswith("<!doctype html>")
    status, shown = said(tmp_path / "one", tmp_path / "two", "--json")
    assert status == 0 and json.loads(shown.out)["causes"][0]["change"] == "moved"
    (tmp_path / "two" / "diagnosis.json").write_text('{"schema": "rtds-diagnosis/3"}')
    status, shown = said(tmp_path / "one", tmp_path / "two")
    assert status == 2 and shown.err.count("\n") == 1 and "two/diagnosis.json" in shown.err
