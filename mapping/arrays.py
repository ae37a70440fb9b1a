"""The arrays of the house: their element types, under one name each; how compiled code is given them; and what numpy is
slow to tell of rows of three."""

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


def lengths(vectors: FloatArray) -> FloatArray:
    """(...) lengths of vectors (..., D), as numpy's norm gives them to the last bit.

    That squares them all and sums over an axis of three, in 23 ns a vector; column by column it is 2 ns.
    """
    square = np.square(vectors[..., 0])
    for k in range(1, vectors.shape[-1]):
        square += np.square(vectors[..., k])
    return np.asarray(np.sqrt(square))


def dots(first: FloatArray, second: FloatArray) -> FloatArray:
    """(...) scalar products of vectors (..., D), as the sums of their products over the last axis, to the last bit."""
    total = first[..., 0] * second[..., 0]
    for k in range(1, first.shape[-1]):
        total += first[..., k] * second[..., k]
    return np.asarray(total)


def sides_of_box(points: FloatArray) -> FloatArray:
    """(D,) sides of the box about points (N, D): as numpy's ptp over the rows, which takes 97 ns a point, not 2."""
    return np.array([np.ptp(column) for column in points.T])
