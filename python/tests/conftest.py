"""Settings of all host tests: one thread a BLAS call, as the command line sets it (same sums, same bytes)."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
