"""The picture of a diagnosis' forms."""

import json

import pytest

from rtds_host.diagnosis.forms.picture import draw, forms_in
from rtds_host.errors import InputError

FORM = {
    "term": "voltage",
    "side": "both",
    "over": "v_cmd",
    "units": ["V", "V"],
    "curve": [[-10.0, -1.0, 0.1], [0.0, 0.0, 0.05], [10.0, 1.0, 0.1]],
    "formula": "a·x",
    "parameters": {"a": {"value": 0.1, "ci90": [0.09, 0.11]}},
    "closes": 0.8,
}


def test_each_form_gets_an_axis_with_its_name_and_units(tmp_path):
    draw([FORM, {**FORM, "formula": None, "curve": [[-1.0, 0.0], [1.0, 1.0]]}], tmp_path / "forms.svg")
    text = (tmp_path / "forms.svg").read_text()
    assert text.count('id="axes_') == 2


def test_a_diagnosis_without_a_form_has_no_picture(tmp_path):
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"forms": []}))
    with pytest.raises(InputError, match="forms: there is none to draw"):
        forms_in(path)


def test_a_file_of_an_unknown_kind_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="forms.xyz"):
        draw([FORM], tmp_path / "forms.xyz")
