"""The table of diagnoses with and without forms."""

import json

from rtds_host.diagnosis.forms import table

SAID = {
    "gap": {"before": 12.3, "after": 4.56, "with_forms": 2.0},
    "effects": [{"id": "coulomb_friction", "side": "both"}],
    "forms": [{"term": "torque", "over": "w", "side": "left"}],
}


def test_a_row_has_gaps_names_forms_and_processor_time():
    cells = dict(zip(table.HEAD, table.row("gear", SAID, 12.4), strict=True))
    assert cells["nominal"] == "12.3" and cells["with effects"] == "4.56" and cells["with forms"] == "2"
    assert cells["named"] == "Coulomb friction (both sides)"
    assert cells["forms"].startswith("torque over wheel speed")
    assert cells["processor, s"] == "12"


def test_a_case_without_effect_or_form_says_so():
    nothing = {"gap": {"before": 1.3, "after": 1.3, "with_forms": None}, "effects": [], "forms": []}
    cells = dict(zip(table.HEAD, table.row("gear", nothing, 1.0), strict=True))
    assert (cells["with forms"], cells["named"], cells["forms"]) == ("none found", "nothing", "none")
    assert table.written([table.row("gear", nothing, 1.0)]).count("\n") == 2


def test_a_case_that_was_diagnosed_is_not_diagnosed_again(tmp_path, monkeypatch):
    asked = []

    def once(case, quick):
        asked.append(quick)
        return SAID, None

    monkeypatch.setattr(table, "read_case", lambda path: path)
    monkeypatch.setattr(table, "diagnose", once)
    first = table.diagnosed(tmp_path, tmp_path / "said", True)
    again = table.diagnosed(tmp_path, tmp_path / "said", True)
    assert asked == [True]
    assert again[0] == first[0] == json.loads((tmp_path / "said" / "diagnosis.json").read_text())
