"""LZF, the compression of PCD files, undone and compiled; every step is checked, so that no damage leads outside.

Reference:
    M. Lehmann, LibLZF: a control byte below 32 begins a run of literals, any other a copy of what was unpacked before.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def unpack_lzf(packed, out):  # type: ignore[no-untyped-def]
    """Unpack (P,) bytes into `out`.

    Returns:
        How many bytes were unpacked; -1 if the bytes are no LZF, or do not fit.
    """
    at, done = np.int64(0), np.int64(0)
    while at < len(packed):
        control = np.int64(packed[at])
        at += 1
        if control < 32:
            count = control + 1
            if at + count > len(packed) or done + count > len(out):
                return -1
            out[done : done + count] = packed[at : at + count]
            at, done = at + count, done + count
            continue
        count = control >> 5
        if count == 7:
            if at >= len(packed):
                return -1
            count += np.int64(packed[at])
            at += 1
        if at >= len(packed):
            return -1
        source = done - ((control & 31) << 8) - np.int64(packed[at]) - 1
        at += 1
        count += 2
        if source < 0 or done + count > len(out):
            return -1
        for number in range(count):
            out[done + number] = out[source + number]
        done += count
    return done
