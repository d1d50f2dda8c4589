"""Settings of all host tests."""

import signal
import sys
from pathlib import Path

import rtds_host  # noqa: F401  before numpy: it sets the threads of a BLAS call

# A test run that a shell put into the background ignores Ctrl-C, and so would the programs whose Ctrl-C is tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# What keeps the documentation's pages and recordings lies with them.
sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
