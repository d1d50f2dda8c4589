"""Host side of the real-time digital simulator of a differential-drive robot's motors."""

import os

# One thread a BLAS call, before numpy is loaded: the program spreads its work itself (two processes of two threads
# each on two cores take ninety times as long), and the same sums in the same order give the same file everywhere.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

__version__ = "0.1.0"
