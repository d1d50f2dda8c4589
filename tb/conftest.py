"""Puts this folder on the import path of the test files: `from common.runner import run_cocotb`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
