"""Memory: what a job sets free goes back to the system, where the allocator is glibc's; another does as it does."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

# glibc's number for the setting (malloc.h), and the size of arrays from which on they have pages of their own: twice a
# share of draws (threads.MOST_VALUES), of which a posterior makes thousands. Once it is set, free memory goes back to
# the system as well, which glibc leaves off when large arrays come and go: the paper's wire took 620 MB, not 530
M_MMAP_THRESHOLD, OWN_PAGES = -3, 2**24
# And how much may stay free before it goes back: by default 128 kB, so that every array of a few hundred kB has its
# pages made and cleared anew: on the paper's wire 650,000 of them, in 1.3 CPU s; with 4 MB 220,000, in 0.7
M_TRIM_THRESHOLD, KEPT_FREE = -1, 2**22
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
    paper's wire took."""
    trim = _of_glibc("malloc_trim")
    if trim is not None:
        trim(0)


def _of_glibc(name: str) -> Callable[..., int] | None:
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
