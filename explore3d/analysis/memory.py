"""Memory: what a job sets free goes back to the system, where the allocator is glibc's; another does as it does."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable

# glibc's number for the setting (malloc.h), and the size of arrays from which on they have pages of their own: twice a
# share of draws (threads.MOST_VALUES), of which a posterior makes thousands. Once it is set, free memory goes back to
# the system as well, which glibc leaves off when large arrays come and go: the paper's wire took 620 MB, not 530
M_MMAP_THRESHOLD, OWN_PAGES = -3, 2**24
# And how much may stay free before it goes back: what a thread's share of draws holds at once (five times 8 MB, see
# threads.MOST_VALUES). By default it is 128 kB, and each array of a few hundred kB, with 4 MB each of some MB, has its
# pages made and cleared anew: 1,030,000 of them in an analysis of the folds, in 3.2 CPU s of the system, with 16 MB
# 600,000 (2.2 s), with 64 MB 210,000 (1.4 s); in a run of the mug 590,000 (1.8 s) and 230,000 (0.9 s). The most memory
# that either takes, 620 and 640 MB, is the same with all of them
M_TRIM_THRESHOLD, KEPT_FREE = -1, 2**26
# And in how many places memory is taken from: one for each thread by default, each with holes of its own
M_ARENA_MAX, PLACES = -8, 1


def leave_no_holes() -> None:
    """Have arrays leave no holes behind, from now on."""
    setting = _of_glibc("mallopt")
    if setting is not None:
        setting(M_MMAP_THRESHOLD, OWN_PAGES)
        setting(M_TRIM_THRESHOLD, KEPT_FREE)
        setting(M_ARENA_MAX, PLACES)


def give_memory_back() -> None:
    """Have what was set free go back now: holes between what lives on stay otherwise, 100 MB of the 550 that the
    paper's wire took. So do arrays in young cycles, 10 MB when its pictures begin, which takes 10 ms."""
    gc.collect(1)
    trim = _of_glibc("malloc_trim")
    if trim is not None:
        trim(0)


def _of_glibc(name: str) -> Callable[..., int] | None:
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
