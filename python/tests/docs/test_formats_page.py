"""The formats' page: citations of its sections lead there, its tables hold what there is, its examples are valid."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import jsonschema
import pytest

from rtds_host.compat import tomllib
from rtds_host.contract import builtin_robots
from rtds_host.contract.robot import NOISE_KEYS, builtin_robot_path
from rtds_host.contract.runlog import RunMeta
from rtds_host.diagnosis.effects import CATALOGUE

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "formats.md").read_text()
SECTIONS = {int(n) for n in re.findall(r"^## (\d+)\. ", PAGE, re.MULTILINE)}
# "contract, section 3", "contract, sections 4 and 5", "the contract's section 7", "the contract (section 2)".
CITATION = re.compile(
    r"contract(?:'s)?[,:]?[\s#*]+\(?(?:its[\s#*]+)?sections?[\s#*]+(\d+)(?:(?:,| and|, and)[\s#*]+(\d+))*", re.I
)


def tracked() -> list[Path]:
    """Text files of the repository that may cite a section."""
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    kinds = {".py", ".md", ".v", ".vh", ".toml", ".cpp", ".js", ".html", ".json"}
    return [ROOT / name for name in names if Path(name).suffix in kinds and (ROOT / name).is_file()]


def cited(text: str) -> list[int]:
    """Section numbers that a text cites of the contract."""
    return [int(n) for m in CITATION.finditer(text) for n in re.findall(r"\d+", m[0])]


def test_the_sections_are_the_seven_that_the_code_cites():
    assert {1, 2, 3, 4, 5, 6, 7} == SECTIONS


def test_every_citation_of_a_section_leads_to_one():
    found = {path: cited(path.read_text(errors="replace")) for path in tracked()}
    assert sum(map(len, found.values())) > 60, "the search for citations finds nothing"
    wrong = {str(path.relative_to(ROOT)): n for path, ns in found.items() for n in ns if n not in SECTIONS}
    assert not wrong


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("(contract, section 3)", [3]),
        ("contract, sections 4 and 5", [4, 5]),
        ("the contract's section 7 says", [7]),
        ("robot of the contract (section 2)", [2]),
        ("a contract between two parties", []),
        ("(contract,\n    # section 2)", [2]),
    ],
)
def test_the_search_knows_how_sections_are_cited(text, numbers):
    assert cited(text) == numbers


def test_pages_that_speak_of_the_contract_name_the_page():
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = page.read_text()
        if page.name != "formats.md" and re.search(r"(?<![./\w-])contract\b(?!/)", text):
            assert "formats.md" in text, page.name


def rows() -> dict[str, tuple[str, list[str], bool]]:
    """id -> (subsystem, parameters, whether it has one side only) of the vocabulary's table."""
    section = PAGE.split("## 3.")[1].split("## 4.")[0]
    found = {}
    for line in section.splitlines():
        cells = [c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 4 and cells[1].startswith("`"):
            found[cells[1].split("`")[1]] = (cells[0], re.findall(r"`(\w+)`", cells[3]), "●" in cells[1])
    return found


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda e: e.id)
def test_the_vocabulary_holds_each_effect_with_its_parameters(effect):
    subsystem, parameters, whole = rows()[effect.id]
    assert effect.subsystem == subsystem
    assert effect.sided is not whole
    own = [p.name for p in effect.parameters]
    assert [name for name in own if name in parameters] == parameters  # further ones of the program follow


def test_the_pages_noise_keys_are_those_that_are_read():
    (robot,) = re.findall(r"```toml\n(schema = .*?)```", PAGE, re.DOTALL)
    assert set(tomllib.loads(robot)["sensors"]) == set(NOISE_KEYS.values())


def schema(name: str) -> dict:
    (path,) = (ROOT / "python" / "rtds_host").rglob(f"{name}.schema.json")
    return json.loads(path.read_text())


def test_the_pages_robot_and_every_built_in_one_follow_the_schema():
    (robot,) = re.findall(r"```toml\n(schema = .*?)```", PAGE, re.DOTALL)
    for text in (robot, *(builtin_robot_path(name).read_text() for name in builtin_robots())):
        jsonschema.validate(tomllib.loads(text), schema("robot"))
    with pytest.raises(jsonschema.ValidationError, match="exclusiveMinimum|minimum"):
        jsonschema.validate(tomllib.loads(robot.replace("mass_kg = 1.0 ", "mass_kg = 0.0 ")), schema("robot"))


def test_the_pages_run_and_one_that_is_written_follow_the_schema():
    (run,) = [b for b in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL) if "rtds-run" in b]
    for content in (json.loads(run), RunMeta(scenario="eight").to_json()):
        jsonschema.validate(content, schema("run"))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"schema": "rtds-run/1", "payload_kg": -1.0}, schema("run"))


def test_the_pages_diagnosis_is_whole_json_whose_shares_sum_to_one():
    (text,) = [b for b in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL) if "rtds-diagnosis" in b]
    diagnosis = json.loads(text)
    for key in ("located", "budget"):
        assert sum(entry["share"] for entry in diagnosis[key]) == pytest.approx(1.0)
    assert sum(a["probability"] for a in diagnosis["alternatives"]) == pytest.approx(1.0)
    for key in diagnosis:
        assert f"`{key}`" in PAGE.split("## 5.")[1] or key in ("schema", "held_out_runs"), f"{key} is not explained"
