"""The file of gains and offsets, and what is refused in it."""

import pytest

from rtds_host.errors import InputError
from rtds_host.link.analog import Line, Paths, load_paths, save_paths


def test_what_is_saved_is_read(tmp_path):
    paths = Paths(
        (Line(1.1, 0.1), Line(), Line(0.9, -0.2), Line()), (Line(1.01, 1e-3),) * 4, {"link": 'a "b"', "n": 3.0}
    )
    save_paths(tmp_path / "c.toml", paths)
    assert load_paths(tmp_path / "c.toml") == paths
    assert [p.name for p in tmp_path.iterdir()] == ["c.toml"]


def test_a_wire_that_is_not_named_is_ideal(tmp_path):
    (tmp_path / "c.toml").write_text("format = 1\n[to_chip.v_r]\ngain = 1.5\n")
    assert load_paths(tmp_path / "c.toml") == Paths((Line(), Line(1.5), Line(), Line()))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "format: 1 is needed"),
        ("format = 2", "format: 1 is needed, found 2"),
        ("format = 1\nto_chips = 1", "to_chips: unknown"),
        ("format = 1\nto_chip = 1", "to_chip: a table"),
        ("format = 1\nabout = 1", "about: a table"),
        ("format = 1\n[to_chip.i_l]\ngain = 1.0", "to_chip.i_l: unknown .known: v_l, v_r, t_l, t_r"),
        ("format = 1\n[to_chip]\nv_l = 2", "to_chip.v_l: a table"),
        ("format = 1\n[to_chip.v_l]\ngian = 1.0", "to_chip.v_l.gian: unknown"),
        ('format = 1\n[to_chip.v_l]\ngain = "1"', "to_chip.v_l.gain: '1' is not a finite number"),
        ("format = 1\n[to_chip.v_l]\ngain = true", "to_chip.v_l.gain: True is not"),
        ("format = 1\n[to_chip.v_l]\ngain = nan", "to_chip.v_l.gain: nan is not a finite number"),
        ("format = 1\n[to_chip.v_l]\ngain = 0.0", "to_chip.v_l.gain: 0 is not between 0.5 and 2"),
        ("format = 1\n[from_chip.w_r]\noffset_v = 1.5", "from_chip.w_r.offset_v: 1.5 V is beyond 1 V"),
        ("format = ", "is not valid TOML"),
    ],
)
def test_a_bad_file_is_refused_in_one_line_that_names_the_place(tmp_path, text, message):
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as refused:
        load_paths(path)
    assert str(refused.value).startswith(str(path)) and "\n" not in str(refused.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_paths(tmp_path / "none.toml")
