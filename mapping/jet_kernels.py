"""Local jets, compiled: nested least-squares fits of degree 2 and 4 over growing neighbourhoods."""

from __future__ import annotations

import numpy as np
from numba import njit

COLUMNS = 15  # monomials of two variables up to degree 4
QUADRATIC = 6
CONDITION = 300.0  # ratio of the diagonal of R beyond which the stencil does not determine the jet


@njit(cache=True)
def _design(u, v, z, count, scale, out):  # type: ignore[no-untyped-def]
    """Columns ordered by degree (so that one QR serves every degree) and the heights, in units of the scale."""
    for i in range(count):
        x, y = u[i] / scale, v[i] / scale
        out[0, i] = 1.0
        out[1, i] = x
        out[2, i] = y
        out[3, i] = x * x
        out[4, i] = x * y
        out[5, i] = y * y
        out[6, i] = x * x * x
        out[7, i] = x * x * y
        out[8, i] = x * y * y
        out[9, i] = y * y * y
        out[10, i] = x * x * x * x
        out[11, i] = x * x * x * y
        out[12, i] = x * x * y * y
        out[13, i] = x * y * y * y
        out[14, i] = y * y * y * y
        out[15, i] = z[i] / scale


@njit(cache=True)
def _householder(a, count, columns):  # type: ignore[no-untyped-def]
    """R in place (row j of the transposed array holds column j) with the heights rotated along."""
    for j in range(columns):
        norm = 0.0
        for i in range(j, count):
            norm += a[j, i] * a[j, i]
        norm = np.sqrt(norm)
        if norm == 0.0:
            continue
        alpha = -norm if a[j, j] > 0 else norm
        head = a[j, j] - alpha
        for i in range(j + 1, count):
            a[j, i] /= head
        tau = -head / alpha
        a[j, j] = alpha
        for c in range(j + 1, COLUMNS + 1):
            if c >= columns and c < COLUMNS:
                continue
            dot = a[c, j]
            for i in range(j + 1, count):
                dot += a[j, i] * a[c, i]
            dot *= tau
            a[c, j] -= dot
            for i in range(j + 1, count):
                a[c, i] -= dot * a[j, i]


@njit(cache=True)
def _solve(a, columns, coefficients, spread):  # type: ignore[no-untyped-def]
    """Coefficients of the nested fit and the variance factors of those of degree 2; False if undetermined."""
    largest = 0.0
    smallest = np.inf
    for j in range(columns):
        size = abs(a[j, j])
        largest = max(largest, size)
        smallest = min(smallest, size)
    if not smallest * CONDITION > largest:
        return False
    for j in range(columns - 1, -1, -1):
        total = a[COLUMNS, j]
        for c in range(j + 1, columns):
            total -= a[c, j] * coefficients[c]
        coefficients[j] = total / a[j, j]
    row = np.zeros(columns)
    for k in range(3):
        target = 3 + k
        square = 0.0
        for j in range(target, columns):
            total = 1.0 if j == target else 0.0
            for c in range(target, j):
                total -= a[j, c] * row[c]
            row[j] = total / a[j, j]
            square += row[j] * row[j]
        spread[k] = square
    return True


@njit(cache=True)
def _weingarten(coefficients, scale, out):  # type: ignore[no-untyped-def]
    """Symmetric 2 x 2 shape operator (a, b, c), outward positive, in an orthonormal basis of the tangent plane."""
    p, q = coefficients[1], coefficients[2]
    first = np.sqrt(1 + p * p)
    cross = p * q / first
    second = np.sqrt(1 + p * p + q * q) / first
    root = np.sqrt(1 + p * p + q * q) * scale
    uu, uv, vv = -2 * coefficients[3] / root, -coefficients[4] / root, -2 * coefficients[5] / root
    out[0] = uu / (first * first)
    out[1] = (uv - cross * uu / first) / (first * second)
    out[2] = (vv - 2 * cross * uv / first + cross * cross * uu / (first * first)) / (second * second)


@njit(cache=True, nogil=True)
def fit_jets(points, normals, smooth, neighbours, chosen, sizes, noise, confidence):  # type: ignore[no-untyped-def]
    """Shape operators of chosen points by Lepski's rule over neighbourhood sizes and degrees.

    Every candidate (size, degree) has an estimate and a standard deviation. From the most variable on, a candidate
    is taken as long as it agrees with all before it; the last one taken has the least variance that bias allows.

    Args:
        points, normals, smooth: (N, 3) positions, normals of the frames, normals that tell sheets apart.
        neighbours: (M, K) indices of the nearest points of each chosen point, nearest first.
        chosen: (M,) indices.
        sizes: (S,) neighbourhood sizes, ascending, at most K.
        noise: standard deviation of the heights, in the points' unit; negative: return residuals alone.
        confidence: half-width of the intervals that must agree, in standard deviations.

    Returns:
        (M, 3) operators, (M, 2, 3) tangent bases, (M,) sds, (M,) residual sds of the smallest quartic fit,
        (M,) sizes and (M,) degrees taken (0: no fit).
    """
    count = len(chosen)
    operators = np.full((count, 3), np.nan)
    bases = np.full((count, 2, 3), np.nan)
    sds = np.full(count, np.nan)
    residuals = np.full(count, np.nan)
    taken = np.zeros(count, dtype=np.int64)
    degrees = np.zeros(count, dtype=np.int64)
    widest = neighbours.shape[1]
    for m in range(count):
        centre = chosen[m]
        n = normals[centre]
        e1 = np.zeros(3)
        axis = 0
        if abs(n[1]) < abs(n[axis]):
            axis = 1
        if abs(n[2]) < abs(n[axis]):
            axis = 2
        e1[axis] = 1.0
        along = n[axis]
        e1 -= along * n
        e1 /= np.sqrt(e1[0] * e1[0] + e1[1] * e1[1] + e1[2] * e1[2])
        e2 = np.array([n[1] * e1[2] - n[2] * e1[1], n[2] * e1[0] - n[0] * e1[2], n[0] * e1[1] - n[1] * e1[0]])
        u, v, z = np.empty(widest), np.empty(widest), np.empty(widest)
        used = 0
        ends = np.zeros(len(sizes), dtype=np.int64)
        for i in range(widest):
            for s in range(len(sizes)):
                if i == sizes[s]:
                    ends[s] = used
            j = neighbours[m, i]
            if j < 0 or j >= len(points):
                continue
            if smooth[j, 0] * n[0] + smooth[j, 1] * n[1] + smooth[j, 2] * n[2] < 0.0:
                continue
            dx = points[j, 0] - points[centre, 0]
            dy = points[j, 1] - points[centre, 1]
            dz = points[j, 2] - points[centre, 2]
            u[used] = dx * e1[0] + dy * e1[1] + dz * e1[2]
            v[used] = dx * e2[0] + dy * e2[1] + dz * e2[2]
            z[used] = dx * n[0] + dy * n[1] + dz * n[2]
            used += 1
        for s in range(len(sizes)):
            if ends[s] == 0 or sizes[s] >= widest:
                ends[s] = used
        candidates = 2 * len(sizes)
        values = np.zeros((candidates, 3))
        spreads = np.full(candidates, np.inf)
        honest = np.full(candidates, np.inf)
        slopes = np.zeros((candidates, 2))
        work = np.empty((COLUMNS + 1, widest))
        coefficients = np.zeros(COLUMNS)
        factor = np.zeros(3)
        operator = np.zeros(3)
        for s in range(len(sizes)):
            size = ends[s]
            if size < QUADRATIC + 2:
                continue
            scale = 0.0
            for i in range(size):
                scale = max(scale, u[i] * u[i] + v[i] * v[i])
            scale = np.sqrt(scale)
            if scale == 0.0:
                continue
            columns = COLUMNS if size >= COLUMNS + 4 else QUADRATIC
            _design(u, v, z, size, scale, work)
            _householder(work, size, columns)
            for degree in range(2):
                terms = COLUMNS if degree == 0 else QUADRATIC
                if terms > columns or not _solve(work, terms, coefficients, factor):
                    continue
                rest = 0.0
                for i in range(terms, size):
                    rest += work[COLUMNS, i] * work[COLUMNS, i]
                rest = np.sqrt(rest / (size - terms)) * scale
                if degree == 0 and np.isnan(residuals[m]):
                    residuals[m] = rest
                _weingarten(coefficients, scale, operator)
                k = 2 * s + degree
                values[k] = operator
                slopes[k, 0], slopes[k, 1] = coefficients[1], coefficients[2]
                unit = np.sqrt(4 * factor[0] + 2 * factor[1] + 4 * factor[2]) / (scale * scale)
                spreads[k] = max(noise, 0.0) * unit
                # a fit that leaves more than the noise is trusted no better than what it leaves
                honest[k] = max(noise, rest) * unit
        if noise < 0:
            continue
        order = np.argsort(-spreads)
        best = -1
        for index in range(candidates):
            k = order[index]
            if not np.isfinite(spreads[k]):
                continue
            agrees = True
            for earlier in range(index):
                o = order[earlier]
                if not np.isfinite(spreads[o]):
                    continue
                gap = 0.0
                for c in range(3):
                    weight = 2.0 if c == 1 else 1.0
                    gap += weight * (values[k, c] - values[o, c]) ** 2
                if gap > (confidence * spreads[o]) ** 2:
                    agrees = False
                    break
            if not agrees:
                break
            best = k
        if best < 0:
            continue
        p, q = slopes[best, 0], slopes[best, 1]
        t1 = e1 + p * n
        t1 /= np.sqrt(1 + p * p)
        t2 = e2 + q * n
        t2 -= (t2[0] * t1[0] + t2[1] * t1[1] + t2[2] * t1[2]) * t1
        t2 /= np.sqrt(t2[0] * t2[0] + t2[1] * t2[1] + t2[2] * t2[2])
        operators[m] = values[best]
        bases[m, 0] = t1
        bases[m, 1] = t2
        # what the rule cannot tell from noise may be bias of half the confidence that it grants
        allowance = 1.0 if best == order[0] else np.sqrt(1 + 0.25 * confidence * confidence)
        sds[m] = allowance * honest[best] / np.sqrt(2.0)
        taken[m] = ends[best // 2]
        degrees[m] = 4 if best % 2 == 0 else 2
    return operators, bases, sds, residuals, taken, degrees
