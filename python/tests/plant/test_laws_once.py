"""Each law of the plant is written once: no other module writes its formula again, but what is apart on purpose."""

import ast

from laws import ROOT, counted, form


def test_a_formula_of_the_plant_is_written_nowhere_else():
    found = {law: [place for place in places if not place.startswith("plant/")] for law, places in counted().items()}
    assert len(found) > 35
    assert {law: places for law, places in found.items() if places} == {}


def test_a_formula_is_the_same_under_other_names():
    one, other, third = (
        form(ast.parse(text, mode="eval").body) for text in ("a * (b - a)", "x * (s[K] - x)", "a * (b - b)")
    )
    assert one == other != third


def test_a_formula_that_is_written_again_is_found(tmp_path):
    (tmp_path / "again.py").write_text((ROOT / "plant" / "friction.py").read_text(encoding="utf-8"), encoding="utf-8")
    found = counted(tmp_path)
    assert all(places == ["again.py"] for law, places in found.items() if law.startswith("friction."))
    assert not found["motor.warmer"]
