"""Gwyddion's count of peaks, from its installed library: another program's answer, to be compared with."""

from __future__ import annotations

import ctypes
import ctypes.util

import numpy as np

from mapping import FloatArray

PARTS = ("gwyddion2", "gwyprocess2")  # the second needs the first


def gwyddion() -> ctypes.CDLL | None:
    """Its library of profiles; None where it is not installed (Debian: libgwyddion20)."""
    paths = [ctypes.util.find_library(name) for name in PARTS]
    if None in paths:
        return None
    library = [ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL) for path in paths][-1]
    line = ctypes.c_void_p
    library.gwy_process_type_init()
    library.gwy_data_line_new.restype, library.gwy_data_line_new.argtypes = (
        line,
        [ctypes.c_int, ctypes.c_double, ctypes.c_int],
    )
    library.gwy_data_line_get_data.restype, library.gwy_data_line_get_data.argtypes = line, [line]
    library.gwy_data_line_count_peaks.argtypes = [line, ctypes.c_int, ctypes.c_double, ctypes.c_double]
    return library


def counted_peaks(library: ctypes.CDLL, heights: FloatArray, limit: float) -> int:
    """Peaks higher than `limit`, with a valley deeper than that between any two.

    Reference: gwy_data_line_count_peaks of libgwyprocess.
    """
    z = np.ascontiguousarray(heights, dtype=np.float64)
    line = library.gwy_data_line_new(len(z), float(len(z)), 0)
    ctypes.memmove(library.gwy_data_line_get_data(line), z.ctypes.data, z.nbytes)
    return int(library.gwy_data_line_count_peaks(line, 1, limit, limit))


def spacing_of_peaks(library: ctypes.CDLL, heights: FloatArray, limit: float) -> tuple[float, int]:
    """Summed length, in samples, and number of the profile elements between the first and the last of those peaks.

    An element begins where the profile last crossed zero before a peak is told; a peak is told in the shortest
    beginning of the profile that has it.
    """

    def begun(count: int) -> float | None:
        low, high = 1, len(heights)
        while low < high:
            middle = (low + high) // 2
            if counted_peaks(library, heights[:middle], limit) >= count:
                high = middle
            else:
                low = middle + 1
        k = low - 1
        while k >= 0 and heights[k] > 0.0:
            k -= 1
        return None if k < 0 else k + heights[k] / (heights[k] - heights[k + 1])

    peaks = counted_peaks(library, heights, limit)
    # what the first peak rises from must be a valley itself
    first = 1 if (heights[: int(begun(1) or 0.0) + 1] < -limit).any() else 2
    begin, end = begun(first), begun(peaks)
    if begin is None or end is None or peaks <= first:
        return 0.0, 0
    return end - begin, peaks - first
