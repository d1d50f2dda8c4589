"""The drawings of the pages are what their command makes, and show what is in the code."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import draw
import pytest

from rtds_host.diagnosis.effects import SUBSYSTEMS

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", draw.DRAWINGS)
def test_a_drawing_is_what_its_command_makes(name):
    made = draw.DRAWINGS[name]()
    assert (ROOT / "docs" / "images" / f"{name}.svg").read_text() == made, "python examples/draw.py draws it"
    drawing = ElementTree.fromstring(made)
    assert drawing.find("{*}title").text
    size = [float(drawing.get(key)) for key in ("width", "height")]
    for text in drawing.iter("{*}text"):
        assert 0 <= float(text.get("x")) <= size[0] and 0 <= float(text.get("y")) <= size[1]


def test_the_chain_names_every_subsystem_but_timing():
    shown = draw.chain().lower()
    assert all(s.replace("wheel_ground", "wheel and ground") in shown for s in SUBSYSTEMS if s != "timing")


def test_the_rooms_that_are_drawn_are_folders():
    rooms = re.findall(r">([a-z]+)/<", draw.rooms())
    folders = {p.name for p in (ROOT / "python" / "rtds_host").rglob("*") if p.is_dir()} | {"rtl", "sim"}
    assert len(rooms) > 12 and set(rooms) <= folders


def test_every_picture_of_a_page_exists_and_every_picture_is_shown():
    shown: set[str] = set()
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page.read_text()):
            assert (page.parent / target).is_file(), (page.name, target)
            shown.add(Path(target).name)
    assert {p.name for p in (ROOT / "docs" / "images").iterdir()} <= shown
