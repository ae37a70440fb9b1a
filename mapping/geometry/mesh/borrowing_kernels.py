"""How kernels are compiled that borrow their arrays: they write to them, but neither make nor keep any (numba)."""

from __future__ import annotations

from numba import njit

# Otherwise numba counts who holds an array, with an instruction that locks the bus, wherever a helper takes one: that
# was half of the time of first contacts, and threads waited for each other over it. `inlined` is for the inner loops
# over a node's lanes, and for what a query calls with many arrays: seven numbers of each are handed over, which was a
# third of the time. numba's own inlining ("always") counts once more in every round.
borrowing = njit(cache=True, error_model="numpy", nogil=True, _nrt=False)
inlined = njit(cache=True, error_model="numpy", nogil=True, _nrt=False, forceinline=True)
