"""Each law of the plant is written once: no other module writes its formula again, but for what is named here."""

import ast

from laws import ROOT, counted, form

# The models of the chip have the chip's own arithmetic. The others are short; this list may only shrink.
AGAIN = {
    "driver.sagging": {"motor/effect_model.py", "motor/model.py"},
    "friction.impulse": {"export/mjcf_forms.py"},
    "gear.spring_start": {"correction/layer.py"},
    "motor.even_current": {"correction/layer.py"},
    "ground.slope_torque": {"correction/layer.py", "export/standalone.py"},
    "ground.body_moves": {"correction/layer.py", "export/standalone.py"},
    "ground.scrub_gain": {"diagnosis/replay/kernel.py", "diagnosis/replay/simd.py"},
}


def test_a_formula_of_the_plant_is_written_nowhere_else():
    found = {law: {p for p in places if not p.startswith("plant/")} for law, places in counted().items()}
    assert len(found) > 30
    assert {law: places for law, places in found.items() if places} == AGAIN


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
