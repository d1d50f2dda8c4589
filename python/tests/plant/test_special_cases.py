"""What is special about an effect is in its own file: other modules do not ask for an effect by its name."""

import ast
from pathlib import Path

import rtds_host
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.plant.schema import ENTRIES

ROOT = Path(rtds_host.__file__).parent


def naming(root: Path) -> dict[str, set[str]]:
    """Modules outside the catalogue and the blind worlds that name effects, parameters' names left out."""
    parameters = ENTRIES.keys() | {entry.export for entry in ENTRIES.values()}
    effects = CATALOGUE.keys() - parameters
    found = {}
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if name.startswith(("blind/", "diagnosis/effects/")):
            continue
        strings = {
            n.value for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Constant)
        }
        if named := {s for s in strings if isinstance(s, str)} & effects:
            found[name] = named
    return found


def test_no_other_module_names_an_effect():
    # A study that fits chosen effects by another program's identification has to name them, and so has the reader of
    # another program's model, which writes what it found there as effects.
    assert naming(ROOT).keys() <= {"bench/sysid.py", "start/mjcf.py"}


def test_a_special_case_is_found(tmp_path):
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "law.py").write_text('if effect == "coulomb_friction": pass\n')
    assert naming(tmp_path) == {"plant/law.py": {"coulomb_friction"}}
