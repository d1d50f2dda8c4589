"""Settings of all host tests."""

import signal

import rtds_host  # noqa: F401  before numpy: it sets the threads of a BLAS call

# A test run that a shell put into the background ignores Ctrl-C, and so would the programs whose Ctrl-C is tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
