"""What holds for every test process: one thread of linear algebra, and few looks for cycles of garbage."""

import gc
import os

# Our matrices are small, and idle threads spin on busy machines
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# As the program itself: what a process of tests loads lives as long as it, and looking at all of it for cycles, again
# and again, was a third of the CPU time in which the tests are collected
gc.set_threshold(50_000)
