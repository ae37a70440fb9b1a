"""Tangents along and across sweeps (numba)."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import BoolArray, FloatArray, IntArray


@njit(cache=True)
def sweep_tangents(
    points: FloatArray, s: FloatArray, begin: IntArray, end: IntArray, most: int, bias: float
) -> FloatArray:
    """Derivative at each point of the polynomial through up to `most` points of its piece [begin, end).

    Of the windows that hold the point, the one of the smallest highest divided difference is taken; the
    central one is kept unless another is smoother by the factor `bias`.
    """
    count = len(points)
    result = np.zeros((count, 3))
    # Highest divided difference of every full window, up to a common factor of its spacing.
    rough = np.full(count, np.inf)
    weight = np.empty(most)
    for w in range(count - most + 1):
        if begin[w] != begin[w + most - 1]:
            continue
        total = np.zeros(3)
        for j in range(most):
            product = 1.0
            for k in range(most):
                if k != j:
                    product *= (s[w + j] - s[w + k]) / (s[w + most - 1] - s[w])
            for c in range(3):
                total[c] += (points[w + j, c] - points[w, c]) / product
        rough[w] = np.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2)
        rough[w] /= (s[w + most - 1] - s[w]) ** (most - 1)
    for i in range(count):
        size = min(most, end[i] - begin[i])
        first = min(max(i - most // 2, begin[i]), end[i] - size)
        if size == most:
            best = rough[first] / bias
            for w in range(max(begin[i], i - most + 1), min(i, end[i] - most) + 1):
                if rough[w] < best:
                    best, first = rough[w], w
        for j in range(size):
            weight[j] = 0.0
            if first + j == i:
                continue
            for skip in range(size):
                if skip == j:
                    continue
                product = 1.0 / (s[first + j] - s[first + skip])
                for k in range(size):
                    if k != j and k != skip:
                        product *= (s[i] - s[first + k]) / (s[first + j] - s[first + k])
                weight[j] += product
            for c in range(3):
                result[i, c] += weight[j] * (points[first + j, c] - points[i, c])
    return result


@njit(cache=True, error_model="numpy")
def lagrange_weights(nodes: FloatArray, at: FloatArray, value: FloatArray, slope: FloatArray) -> None:
    """Write weights (K, m) of the interpolating polynomial's value and derivative at `at` (K,) for nodes (K, m)."""
    count = nodes.shape[1]
    for i in range(len(nodes)):
        for j in range(count):
            product, total = 1.0, 0.0
            for k in range(count):
                if k != j:
                    product *= (at[i] - nodes[i, k]) / (nodes[i, j] - nodes[i, k])
            for skip in range(count):
                if skip == j:
                    continue
                factors = 1.0
                for k in range(count):
                    if k != j:
                        gap = nodes[i, j] - nodes[i, k]
                        factors *= 1.0 / gap if k == skip else (at[i] - nodes[i, k]) / gap
                total += factors
            value[i, j], slope[i, j] = product, total


# Of the polynomials across sweeps: those through five sweeps have error terms of the fifth derivative, as the stencils
# along a sweep do
HIGHEST_ORDER = 4


@njit(cache=True, error_model="numpy")
def smooth_slopes(
    v: FloatArray,
    w: FloatArray,
    one_sided: float,
    higher: float,
    slope: FloatArray,
    bend: FloatArray,
    doubt: FloatArray,
) -> None:
    """Write slope, second derivative and doubt of each row's w(v) (N, 2 k + 1) at the middle (see `smooth_slope`).

    Args:
        one_sided: factor by which a polynomial to one side must be smoother than the others.
        higher: share of the curvature that a higher term may have.
    """
    middle = v.shape[1] // 2
    table = np.empty((HIGHEST_ORDER + 1, v.shape[1]))  # divided differences, NaN where one is missing
    for n in range(len(v)):
        at = v[n]
        table[0] = w[n]
        for order in range(1, HIGHEST_ORDER + 1):
            for k in range(v.shape[1] - order):
                table[order, k] = (table[order - 1, k + 1] - table[order - 1, k]) / (at[k + order] - at[k])
        for order in range(2, HIGHEST_ORDER + 1):
            best, second = _smoothest(table[order], middle, order, one_sided)
            found, other = _slope_there(at, table, best, order), _slope_there(at, table, second, order)
            bent = 2.0 * table[2, min(max(middle - 1, best), best + order - 2)]
            spacing = abs(at[best + order] - at[best]) / order
            last = abs(table[order, best]) * spacing ** (order - 1)
            falling = last <= higher * abs(bent) * spacing
            # where the second smoothest window sees another slope, a kink or a jump of curvature lies beside the sample
            last = np.fmax(last, abs(found - other))
            if order == 2 or falling:
                slope[n], bend[n], doubt[n] = found, bent, last
            elif order == 3:  # a cubic that is refused still tells how little the parabola knew
                doubt[n] = np.fmax(doubt[n], last)


@njit(cache=True, error_model="numpy")
def _smoothest(differences, middle, order, one_sided):  # type: ignore[no-untyped-def]
    """First columns of the two windows of an order about the middle whose highest difference is smallest."""
    best, second = -1, -1
    least = next_ = np.inf
    for k in range(order + 1):
        size = abs(differences[middle - order + k]) * (one_sided if k in (0, order) else 1.0)
        size = np.inf if np.isnan(size) else size
        if best < 0 or size < least:
            best, second, least, next_ = k, best, size, least
        elif second < 0 or size < next_:
            second, next_ = k, size
    return middle - order + best, middle - order + second


@njit(cache=True, error_model="numpy")
def _slope_there(v, table, first, order):  # type: ignore[no-untyped-def]
    """Slope at v = 0 of the polynomial through columns first to first + order, by Newton's form."""
    value, slope = table[order, first], 0.0
    for k in range(order - 1, -1, -1):
        slope = value - slope * v[first + k]
        value = table[k, first] - value * v[first + k]
    return slope


QUADRATIC_TERMS = 6  # terms of a quadratic of two variables
# Ratio of the diagonal of R below which neighbours do not determine all terms: on one line it is rounding, 1e-16, and
# at 1e-6 the coefficients have ten digits; what lies between is as well left to a singular value decomposition.
DETERMINED = 1e-6


@njit(cache=True)
def slopes_across(
    u: FloatArray, v: FloatArray, w: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Slope along v of the weighted least-squares quadratic w(u, v) of each row, by Householder reflections.

    Args:
        u, v, w: (N, K) coordinates of the neighbours of each sample, of about unit size.
        weight: (N, K) of each neighbour: heights and terms are multiplied by it.

    Returns:
        (N,) slopes at the origin, (N,) roots of the mean of weight times squared residual, and (N,) whether the
        neighbours determine all terms; where they do not, slope and residual mean nothing.
    """
    count, near = u.shape
    slope, residual, determined = np.zeros(count), np.zeros(count), np.zeros(count, np.bool_)
    columns = np.empty((QUADRATIC_TERMS + 1, near))  # the last holds the heights
    fit = np.empty(QUADRATIC_TERMS)
    for i in range(count if near > QUADRATIC_TERMS else 0):
        for k in range(near):
            x, y, g = u[i, k], v[i, k], weight[i, k]
            columns[0, k], columns[1, k], columns[2, k] = g, g * x, g * y
            columns[3, k], columns[4, k], columns[5, k] = g * x * x, g * x * y, g * y * y
            columns[QUADRATIC_TERMS, k] = g * w[i, k]
        largest, smallest = 0.0, np.inf
        for j in range(QUADRATIC_TERMS):
            square = 0.0
            for k in range(j, near):
                square += columns[j, k] ** 2
            norm = np.sqrt(square)
            largest, smallest = max(largest, norm), min(smallest, norm)
            if norm == 0.0:
                break
            head = columns[j, j] + (norm if columns[j, j] > 0.0 else -norm)
            tau = abs(head) * norm  # half the squared length of the reflected vector
            diagonal = -norm if columns[j, j] > 0.0 else norm
            columns[j, j] = head
            for c in range(j + 1, QUADRATIC_TERMS + 1):
                dot = 0.0
                for k in range(j, near):
                    dot += columns[j, k] * columns[c, k]
                dot /= tau
                for k in range(j, near):
                    columns[c, k] -= dot * columns[j, k]
            columns[j, j] = diagonal
        if not smallest > DETERMINED * largest:
            continue
        determined[i] = True
        for j in range(QUADRATIC_TERMS - 1, -1, -1):
            total = columns[QUADRATIC_TERMS, j]
            for c in range(j + 1, QUADRATIC_TERMS):
                total -= columns[c, j] * fit[c]
            fit[j] = total / columns[j, j]
        slope[i] = fit[2]
        square = 0.0
        for k in range(near):
            x, y = u[i, k], v[i, k]
            gap = w[i, k] - (fit[0] + x * (fit[1] + x * fit[3] + y * fit[4]) + y * (fit[2] + y * fit[5]))
            square += weight[i, k] * gap * gap
        residual[i] = np.sqrt(square / near)
    return slope, residual, determined
