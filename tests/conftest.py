"""One thread of linear algebra a test process: our matrices are small, and idle threads spin on busy machines."""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
