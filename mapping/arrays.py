"""The arrays of the house: their element types, under one name each; and how compiled code is given them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ShortArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

Scalar = TypeVar("Scalar", bound=np.generic)


def read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """A contiguous view of the array, or a copy, that cannot be written to.

    For numba an array that can be written to is of another type than one that cannot: a kernel that is given now one,
    now the other, is compiled, for seconds, for every combination of its arguments that comes.
    """
    view = np.ascontiguousarray(array).view()
    view.setflags(write=False)
    return view
