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


def test_the_rooms_that_are_drawn_are_folders_of_the_architecture_page():
    rooms = re.findall(r">([a-z]+)/<", draw.rooms())
    named = {part for path in rows_of_architecture() for part in path.relative_to(ROOT).parts}
    assert len(rooms) > 12 and len(set(rooms)) == len(rooms)
    assert set(rooms) <= named


def rows_of_architecture() -> list[Path]:
    """What the tables of docs/architecture.md name, a path for each name, as often as it is named."""
    found: list[Path] = []
    host = ROOT / "python" / "rtds_host"
    for line in (ROOT / "docs" / "architecture.md").read_text().splitlines():
        if not line.startswith("| "):
            continue
        *names, _text = line.strip("| ").split(" | ")
        folder = None
        for name in re.findall(r"`([^`]+)`", " ".join(names)):
            many = re.fullmatch(r"(.*)\{(.+)\}", name)
            for one in [many[1] + end for end in many[2].split(",")] if many else [name]:
                places = [base for base in (ROOT, host, folder) if base and any(base.glob(one.rstrip("/")))]
                assert places, f"{name} of docs/architecture.md is not there"
                found.append(places[0] / one)
                folder = found[-1].parent
    return found


def test_each_row_of_the_architecture_names_what_is_there_and_no_two_the_same():
    rows = rows_of_architecture()
    assert len(rows) > 50
    twice = {path for path in rows if rows.count(path) > 1}
    assert not twice, f"more than one row each: {sorted(str(p) for p in twice)}"


def test_the_architecture_names_every_room_and_every_module_of_the_diagnosis():
    host = ROOT / "python" / "rtds_host"
    folders = [p for p in host.iterdir() if (p / "__init__.py").is_file()]
    modules = [p for p in (host / "diagnosis").iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()]
    named = {path for row in rows_of_architecture() for path in row.parent.glob(row.name)}
    missing = [p.relative_to(host) for p in folders + modules if p not in named and p.name != "__init__.py"]
    assert [str(p) for p in missing] == ["diagnosis/effects"], "the effects have a section of their own"


def test_every_picture_of_a_page_exists_and_every_picture_is_shown():
    shown: set[str] = set()
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page.read_text()):
            assert (page.parent / target).is_file(), (page.name, target)
            shown.add(Path(target).name)
    assert {p.name for p in (ROOT / "docs" / "images").iterdir()} <= shown
