"""What is special about an effect is in its own file: other modules do not ask for an effect by its name."""

import ast
from pathlib import Path

import rtds_host
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.plant.schema import ENTRIES

ROOT = Path(rtds_host.__file__).parent


def compared(tree: ast.AST) -> set[str]:
    """Strings that something is compared with, by `==`, `in` or `match`."""
    kinds = (ast.Compare, ast.MatchValue)
    inside = (n for node in ast.walk(tree) if isinstance(node, kinds) for n in ast.walk(node))
    return {n.value for n in inside if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def naming(root: Path) -> dict[str, set[str]]:
    """Modules outside the catalogue and the blind worlds that name effects. Where a parameter of the plant has an
    effect's name, too, only what is compared with it counts.
    """
    parameters = ENTRIES.keys() | {entry.export for entry in ENTRIES.values()}
    found = {}
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if name.startswith(("blind/", "diagnosis/effects/")):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        strings = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
        if named := ((strings - parameters) | compared(tree)) & CATALOGUE.keys():
            found[name] = named
    return found


def test_no_other_module_names_an_effect():
    # A study that fits chosen effects by another program's identification has to name them, and so has the reader of
    # another program's model, which writes what it found there as effects.
    assert naming(ROOT).keys() <= {"bench/sysid.py", "start/mjcf.py"}


def test_a_special_case_is_found(tmp_path):
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "law.py").write_text('if effect == "coulomb_friction": pass\n')
    (tmp_path / "plant" / "shared.py").write_text('LOOSE = effect in ("backlash", "stiffness")\n')
    (tmp_path / "plant" / "parameter.py").write_text('play = model.get("backlash")\n')
    assert naming(tmp_path) == {"plant/law.py": {"coulomb_friction"}, "plant/shared.py": {"backlash"}}
