"""Puts the Verilog and what builds it into the wheel, as rtds_host/hardware; all the rest stands in pyproject.toml."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
WANTED = {"rtl": (".v", ".vh", ".f"), "sim": (".v", ".h", ".vlt", ".cpp", ".py")}


class BuildWithHardware(build_py):
    """Copies `WANTED` beside the package's modules; an editable installation uses them where they are."""

    def run(self):
        super().run()
        if self.editable_mode:
            return
        for folder, endings in WANTED.items():
            for path in sorted((ROOT / folder).rglob("*")):
                if path.suffix in endings:
                    target = Path(self.build_lib) / "rtds_host" / "hardware" / path.relative_to(ROOT)
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(path, target)


setup(cmdclass={"build_py": BuildWithHardware})
