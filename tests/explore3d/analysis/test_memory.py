"""What is set free goes back to the system, but what is asked for again at once stays."""

from __future__ import annotations

import subprocess
import sys
import weakref

import pytest

from explore3d.analysis.memory import give_memory_back

ARRAYS_AT_ONCE = """
import resource
import numpy as np
from explore3d.analysis import leave_no_holes

def some():
    return [np.ones(2**18) for _ in range(20)]

leave_no_holes()
some()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    some()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="settings of glibc")
def test_arrays_that_come_and_go_keep_their_pages() -> None:
    told = subprocess.run([sys.executable, "-c", ARRAYS_AT_ONCE], capture_output=True, text=True, check=True)
    # 40 MB are 10,240 pages, which were made anew each time
    assert int(told.stdout) < 10_240


def test_an_array_in_a_cycle_is_given_back() -> None:
    class Held:
        """What refers to itself."""

    held = Held()
    held.own, gone = held, weakref.ref(held)
    del held
    give_memory_back()
    assert gone() is None
