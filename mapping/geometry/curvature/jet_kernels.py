"""Local jets, compiled: nested least-squares fits of degree 2, 4 and 6 over growing neighbourhoods."""

from __future__ import annotations

import numpy as np
from numba import njit

MONOMIALS = 28  # monomials of two variables up to degree 6
TERMS_OF_DEGREE = np.array([6, 15, 28])  # those of degree 2, 4 and 6
SPARE_POINTS = np.array([2, 4, 4])  # points that a fit needs beyond its terms
CONDITION = 1e5  # ratio of the diagonal of R beyond which the stencil does not determine the jet
# Independent neighbourhoods among those of a pool: one, and so many for each time that the pool's points fill one
INDEPENDENT_SHARE = 0.75
# Squared gap at one point over its expectation that noise does not make: half of the expectation is the mean
# curvature's, and five standard deviations of it are 25 / 2.
CERTAIN_GAP = 12.5

# Numbers of 8 bytes that one instruction of 32 bytes takes at once: new rows are filled up with zeros to a multiple
FILLED_UP_TO = 4
# Monomials up to degree 12, the products of two of degree 6
PRODUCTS = 91
# Of each row of normal equations: where the heights stand, behind the 28 monomials up to degree 6, and six columns of
# the identity; and its length, which is filled up to a multiple of what two instructions take
HEIGHTS_AT, IDENTITY_AT, EQUATION = 28, 29, 40
# Sizes apart of two fits that judge each other's bias: about twice as many points
JUDGE_STEPS = 2
LEAST_SQUARED_ERROR = 1e-28  # squared error of a curvature that is never undercut, for bodies of about unit size


@njit(cache=True)
def _design(u, v, z, first, last, scale, degree, out):  # type: ignore[no-untyped-def]
    """Columns ordered by degree (so that one QR serves every degree) and the heights behind them, in units of the
    scale; how many rows they fill, zeros at the end among them."""
    points, heights = last - first, TERMS_OF_DEGREE[degree // 2 - 1]
    count = -(-points // FILLED_UP_TO) * FILLED_UP_TO
    for i in range(points):
        out[0, i] = 1.0
        out[1, i] = u[first + i] / scale
        out[2, i] = v[first + i] / scale
        out[heights, i] = z[first + i] / scale
    for i in range(points, count):
        out[0, i], out[1, i], out[2, i], out[heights, i] = 0.0, 0.0, 0.0, 0.0
    column = 3
    for d in range(2, degree + 1):
        for p in range(d):
            for i in range(count):
                out[column + p, i] = out[1, i] * out[column - d + p, i]
        for i in range(count):
            out[column + d, i] = out[2, i] * out[column - 1, i]
        column += d + 1
    return count


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _absorb(triangle, rows, count, columns):  # type: ignore[no-untyped-def]
    """Fold new rows into R and the rotated heights by reflections that leave R's zeros alone.

    Row j of either array holds column j of the least-squares problem, and row `columns` the heights, so that the inner
    loops run along memory. Two reflections are applied together, to four columns at a time: what is read then serves
    several products (Schreiber and Van Loan 1989).

    Returns:
        sum of squares of the part of the new heights that no column explains.
    """
    for j in range(0, columns, 2):
        k = j + 1
        one = _reflection(triangle, rows, count, j)
        both = 0.0
        for i in range(count):
            both += rows[j, i] * rows[k, i]
        share = _reflected(triangle, k, j, one, both)
        for i in range(count):
            rows[k, i] -= share * rows[j, i]
        if k == columns:
            break
        other = _reflection(triangle, rows, count, k)
        both = 0.0
        for i in range(count):
            both += rows[j, i] * rows[k, i]
        c = k + 1
        while c + 3 <= columns:
            p0, p1, p2, p3, q0, q1, q2, q3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(count):
                p, q = rows[j, i], rows[k, i]
                a, b, x, y = rows[c, i], rows[c + 1, i], rows[c + 2, i], rows[c + 3, i]
                p0 += p * a
                p1 += p * b
                p2 += p * x
                p3 += p * y
                q0 += q * a
                q1 += q * b
                q2 += q * x
                q3 += q * y
            p0, q0 = _twice_reflected(triangle, c, j, one, other, both, p0, q0)
            p1, q1 = _twice_reflected(triangle, c + 1, j, one, other, both, p1, q1)
            p2, q2 = _twice_reflected(triangle, c + 2, j, one, other, both, p2, q2)
            p3, q3 = _twice_reflected(triangle, c + 3, j, one, other, both, p3, q3)
            for i in range(count):
                p, q = rows[j, i], rows[k, i]
                rows[c, i] -= p0 * p + q0 * q
                rows[c + 1, i] -= p1 * p + q1 * q
                rows[c + 2, i] -= p2 * p + q2 * q
                rows[c + 3, i] -= p3 * p + q3 * q
            c += 4
        while c <= columns:
            p, q = 0.0, 0.0
            for i in range(count):
                p += rows[j, i] * rows[c, i]
                q += rows[k, i] * rows[c, i]
            p, q = _twice_reflected(triangle, c, j, one, other, both, p, q)
            for i in range(count):
                rows[c, i] -= p * rows[j, i] + q * rows[k, i]
            c += 1
    rest = 0.0
    for i in range(count):
        rest += rows[columns, i] * rows[columns, i]
    return rest


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _reflection(triangle, rows, count, j):  # type: ignore[no-untyped-def]
    """(head, tau) of the reflection by the vector of `head` in R's row j and rows[j] in the new ones, which makes zeros
    of the latter's column j. Zeros where they are that already."""
    square = 0.0
    for i in range(count):
        square += rows[j, i] * rows[j, i]
    if square == 0.0:
        return 0.0, 0.0
    norm = np.sqrt(square + triangle[j, j] * triangle[j, j])
    alpha = -norm if triangle[j, j] > 0 else norm
    head = triangle[j, j] - alpha
    triangle[j, j] = alpha
    return head, -1.0 / (alpha * head)


@njit(cache=True, inline="always")
def _reflected(triangle, c, j, reflection, product):  # type: ignore[no-untyped-def]
    """How many of the vector of column j a reflection takes off column c, whose new rows have that product with it."""
    head, tau = reflection
    share = (product + head * triangle[c, j]) * tau
    triangle[c, j] -= share * head
    return share


@njit(cache=True, inline="always")
def _twice_reflected(triangle, c, j, one, other, both, p, q):  # type: ignore[no-untyped-def]
    """The same of the reflections of columns j and j + 1, one after the other; `both` is the product of their vectors
    in the new rows, p and q are the column's with either."""
    first = _reflected(triangle, c, j, one, p)
    return first, _reflected(triangle, c, j + 1, other, q - first * both)


@njit(cache=True)
def _determined(triangle, columns, ratio):  # type: ignore[no-untyped-def]
    """False if the stencil does not determine the jet; `ratio` scales columns by the neighbourhood's own size."""
    largest, smallest, power, j, degree = 0.0, np.inf, 1.0, 0, 0
    while j < columns:
        for _ in range(degree + 1):
            size = abs(triangle[j, j]) * power
            largest, smallest = max(largest, size), min(smallest, size)
            j += 1
        degree += 1
        power *= ratio
    return smallest * CONDITION > largest


@njit(cache=True)
def _invert(triangle, columns, inverse):  # type: ignore[no-untyped-def]
    """The first six rows of the inverse of R, of which row j of the triangle holds column j, as (columns, 6)."""
    for j in range(columns):
        r0, r1, r2 = 1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0
        r3, r4, r5 = 1.0 if j == 3 else 0.0, 1.0 if j == 4 else 0.0, 1.0 if j == 5 else 0.0
        for k in range(j):
            share = triangle[j, k]
            r0 -= share * inverse[k, 0]
            r1 -= share * inverse[k, 1]
            r2 -= share * inverse[k, 2]
            r3 -= share * inverse[k, 3]
            r4 -= share * inverse[k, 4]
            r5 -= share * inverse[k, 5]
        own = 1.0 / triangle[j, j]
        inverse[j, 0], inverse[j, 1], inverse[j, 2] = r0 * own, r1 * own, r2 * own
        inverse[j, 3], inverse[j, 4], inverse[j, 5] = r3 * own, r4 * own, r5 * own


@njit(cache=True)
def _nested(inverse, heights, columns, coefficients, factors):  # type: ignore[no-untyped-def]
    """Coefficients (D, 6) up to second degree of all nested fits of at most so many columns, and the variance factors
    (D,) of their curvatures (squared Frobenius norms).

    Six rows of the inverse of R and the rotated heights tell all of them: what is summed over fewer columns is the fit
    of these alone.
    """
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    a, b, c, option = 0.0, 0.0, 0.0, 0
    for j in range(columns):
        height = heights[j]
        r3, r4, r5 = inverse[j, 3], inverse[j, 4], inverse[j, 5]
        s0, s1, s2 = s0 + height * inverse[j, 0], s1 + height * inverse[j, 1], s2 + height * inverse[j, 2]
        s3, s4, s5 = s3 + height * r3, s4 + height * r4, s5 + height * r5
        a, b, c = a + r3 * r3, b + r4 * r4, c + r5 * r5
        if j + 1 == TERMS_OF_DEGREE[option]:
            coefficients[option, 0], coefficients[option, 1], coefficients[option, 2] = s0, s1, s2
            coefficients[option, 3], coefficients[option, 4], coefficients[option, 5] = s3, s4, s5
            factors[option] = 4.0 * a + 2.0 * b + 4.0 * c
            option += 1


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _add_moments(place, first, last, scale, degree, room, moments, heights):  # type: ignore[no-untyped-def]
    """Add points first to last to the sums of all monomials up to twice the degree, and of those up to the degree times
    the height, both in the order of the columns; the points' sum of squared heights. `room` is of (5, K + 4)."""
    points = last - first
    count = -(-points // FILLED_UP_TO) * FILLED_UP_TO
    u, v, z, power, term = room[0], room[1], room[2], room[3], room[4]
    for i in range(points):
        u[i], v[i] = place[0, first + i] / scale, place[1, first + i] / scale
        z[i], power[i] = place[2, first + i] / scale, 1.0
    for i in range(points, count):
        u[i], v[i], z[i], power[i] = 0.0, 0.0, 0.0, 0.0
    square = 0.0
    for i in range(count):
        square += z[i] * z[i]
    for q in range(2 * degree + 1):
        for i in range(count):
            term[i] = power[i]
        _add_powers(u, term, count, q, 2 * degree, moments)
        if q <= degree:
            for i in range(count):
                term[i] = power[i] * z[i]
            _add_powers(u, term, count, q, degree, heights)
        for i in range(count):
            power[i] *= v[i]
    return square


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _add_powers(u, term, count, q, degree, sums):  # type: ignore[no-untyped-def]
    """Add the sums of term, term u, term u^2 ..., of which the first is of degree q in v, four in one pass."""
    d = q
    while d <= degree:
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for i in range(count):
            t, x = term[i], u[i]
            s0 += t
            t *= x
            s1 += t
            t *= x
            s2 += t
            t *= x
            s3 += t
            term[i] = t * x
        sums[d * (d + 1) // 2 + q] += s0
        if d + 1 <= degree:
            sums[(d + 1) * (d + 2) // 2 + q] += s1
        if d + 2 <= degree:
            sums[(d + 2) * (d + 3) // 2 + q] += s2
        if d + 3 <= degree:
            sums[(d + 3) * (d + 4) // 2 + q] += s3
        d += 4


@njit(cache=True)
def _normal_equations(moments, heights, columns, rows):  # type: ignore[no-untyped-def]
    """Write the products of the columns, on and right of the diagonal, beside them those with the heights, and the
    identity's first six columns. The product of two monomials is one of the moments."""
    j, d = 0, 0
    while j < columns:
        for q in range(d + 1):
            for c in range(EQUATION):
                rows[j, c] = 0.0
            c, other = d * (d + 1) // 2, d
            while c < columns:
                start = (d + other) * (d + other + 1) // 2 + q
                for i in range(other + 1):
                    rows[j, c + i] = moments[start + i]
                c += other + 1
                other += 1
            rows[j, HEIGHTS_AT] = heights[j]
            if j < 6:
                rows[j, IDENTITY_AT + j] = 1.0
            j += 1
        d += 1


@njit(cache=True, fastmath={"contract", "nsz"})
def _cholesky(rows, columns):  # type: ignore[no-untyped-def]
    """Make R of the products of the columns, beside it the rotated heights and the first six rows of its inverse, each
    as a column. It ends with a zero on the diagonal where a column depends on those before it.

    Two rows at a time and four by four, so that what is read and written serves several products. With terms
    reassociated a product with a reciprocal becomes a division again, of every number of the row.
    """
    for j in range(0, columns, 2):
        one, other, k = rows[j], rows[j + 1], 0
        while k + 3 < j:
            w, x, y, z = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
            a, b, c, d = w[j], x[j], y[j], z[j]
            e, f, g, h = w[j + 1], x[j + 1], y[j + 1], z[j + 1]
            for i in range(EQUATION):
                one[i] -= a * w[i] + b * x[i] + c * y[i] + d * z[i]
                other[i] -= e * w[i] + f * x[i] + g * y[i] + h * z[i]
            k += 4
        if k < j:
            w, x = rows[k], rows[k + 1]
            a, b, e, f = w[j], x[j], w[j + 1], x[j + 1]
            for i in range(EQUATION):
                one[i] -= a * w[i] + b * x[i]
                other[i] -= e * w[i] + f * x[i]
        if not one[j] > 0.0:
            one[j] = 0.0
            return
        a, left = 1.0 / np.sqrt(one[j]), 0.0
        if j + 1 < columns:
            c = one[j + 1] * a
            left = other[j + 1] - c * c
        if not left > 0.0:
            for i in range(EQUATION):
                one[i] *= a
            other[j + 1] = 0.0
            return
        b = 1.0 / np.sqrt(left)
        for i in range(EQUATION):
            first = one[i] * a
            one[i] = first
            other[i] = (other[i] - c * first) * b


@njit(cache=True)
def _weingarten(coefficients, scale, bend, out):  # type: ignore[no-untyped-def]
    """Symmetric 2 x 2 shape operator (a, b, c), outward positive, in an orthonormal basis of the tangent plane."""
    # derivatives of z from those of the bent ordinate z + bend z^2 / 2
    rise = np.sqrt(max(1 + 2 * bend * coefficients[0], 0.25))
    p, q = coefficients[1] / rise, coefficients[2] / rise
    zuu, zuv, zvv = (
        2 * coefficients[3] - bend * p * p,
        coefficients[4] - bend * p * q,
        2 * coefficients[5] - bend * q * q,
    )
    first = np.sqrt(1 + p * p)
    cross = p * q / first
    second = np.sqrt(1 + p * p + q * q) / first
    root = np.sqrt(1 + p * p + q * q) * scale * rise
    uu, uv, vv = -zuu / root, -zuv / root, -zvv / root
    out[0] = uu / (first * first)
    out[1] = (uv - cross * uu / first) / (first * second)
    out[2] = (vv - 2 * cross * uv / first + cross * cross * uu / (first * first)) / (second * second)


@njit(cache=True)
def _frame(n):  # type: ignore[no-untyped-def]
    """Two unit vectors that span the plane perpendicular to n."""
    axis = 0
    if abs(n[1]) < abs(n[axis]):
        axis = 1
    if abs(n[2]) < abs(n[axis]):
        axis = 2
    e1 = -n[axis] * n
    e1[axis] += 1.0
    e1 /= np.sqrt(e1[0] * e1[0] + e1[1] * e1[1] + e1[2] * e1[2])
    e2 = np.array([n[1] * e1[2] - n[2] * e1[1], n[2] * e1[0] - n[0] * e1[2], n[0] * e1[1] - n[1] * e1[0]])
    return e1, e2


@njit(cache=True)
def _gather(points, normals, near, centre, e1, e2, bend, alike, sizes, place, ends):  # type: ignore[no-untyped-def]
    """Coordinates of the neighbours on this side of the body, z bent; `ends` counts them for each size."""
    n, used, s = normals[centre], 0, 0
    for i in range(len(near)):
        while s < len(sizes) and i == sizes[s]:
            ends[s] = used
            s += 1
        j = near[i]
        if j < 0 or j >= len(points):
            continue
        if normals[j, 0] * n[0] + normals[j, 1] * n[1] + normals[j, 2] * n[2] < alike:
            continue
        dx, dy, dz = (
            points[j, 0] - points[centre, 0],
            points[j, 1] - points[centre, 1],
            points[j, 2] - points[centre, 2],
        )
        place[0, used] = dx * e1[0] + dy * e1[1] + dz * e1[2]
        place[1, used] = dx * e2[0] + dy * e2[1] + dz * e2[2]
        z = dx * n[0] + dy * n[1] + dz * n[2]
        place[2, used] = z + 0.5 * bend * z * z
        used += 1
    ends[s:] = used
    return used


@njit(cache=True)
def _reach(place, first, last, reach):  # type: ignore[no-untyped-def]
    """Largest squared distance from the axis, of those before and points first to last."""
    for i in range(first, last):
        reach = max(reach, place[0, i] * place[0, i] + place[1, i] * place[1, i])
    return reach


@njit(cache=True, nogil=True)
def fit_jets(points, normals, neighbours, chosen, bends, alike, sizes, degree, by_moments):  # type: ignore[no-untyped-def]
    """Shape operators of chosen points by every neighbourhood size and every even degree up to the given one.

    The sizes are nested: each adds its new points to what is known of the one before, and one triangle serves all
    degrees, so that all candidates together cost little more than one fit over the largest neighbourhood. What is known
    is the triangle itself, which reflections keep exact; or the moments, in half the time: the products of columns
    that are monomials are few monomials of twice the degree. Squares keep half of the digits, which noise may not need.

    The ordinate of the fits is z + k z^2 / 2, which is quadratic on a sphere or cylinder of curvature k, however much
    of it the neighbourhood holds: a polynomial of z over the tangent plane would have to follow a square root.

    Args:
        points, normals: (N, 3) positions and the normals of the frames; neighbours on another side are left out.
        neighbours: (M, K) indices of the nearest points of each chosen point, nearest first; others are skipped.
        chosen: (M,) indices.
        bends: (M,) about the curvature of larger absolute value there, outward positive; 0 if not known.
        alike: cosine of the angle by which the normals of one side turn at most.
        sizes: (S,) neighbourhood sizes, ascending, at most K.
        degree: 2, 4 or 6.
        by_moments: False to keep all digits.

    Returns:
        (M, S, D, 3) operators, NaN where undetermined; (M, S, D) standard deviations per unit of noise (Frobenius);
        (M, S, D) standard deviations of the residuals; (M, S, D, 2) slopes of the fits in the normals' frames.
    """
    count, options = len(chosen), degree // 2
    operators = np.full((count, len(sizes), options, 3), np.nan)
    factors = np.full((count, len(sizes), options), np.inf)
    rests = np.full((count, len(sizes), options), np.nan)
    slopes = np.zeros((count, len(sizes), options, 2))
    widest, columns = neighbours.shape[1], TERMS_OF_DEGREE[options - 1]
    place, room = np.empty((3, widest)), np.empty((5, widest + FILLED_UP_TO))
    rows = np.empty((MONOMIALS + 1, widest + FILLED_UP_TO))
    triangle = np.empty((MONOMIALS + 1, MONOMIALS))
    heights, inverse = np.zeros(MONOMIALS), np.zeros((MONOMIALS, 6))
    moments, products, equations = np.empty(PRODUCTS), np.empty(MONOMIALS), np.zeros((MONOMIALS, EQUATION))
    coefficients, variances = np.zeros((options, 6)), np.zeros(options)
    ends = np.zeros(len(sizes), dtype=np.int64)
    for m in range(count):
        e1, e2 = _frame(normals[chosen[m]])
        used = _gather(points, normals, neighbours[m], chosen[m], e1, e2, bends[m], alike, sizes, place, ends)
        scale = np.sqrt(_reach(place, 0, used, 0.0))
        if scale == 0.0:
            continue
        triangle[:], moments[:], products[:] = 0.0, 0.0, 0.0
        rest, first, reach = 0.0, 0, 0.0
        for s in range(len(sizes)):
            last = ends[s]
            if last == first:
                continue
            reach = _reach(place, first, last, reach)
            if by_moments:
                rest += _add_moments(place, first, last, scale, degree, room, moments, products)
            else:
                filled = _design(place[0], place[1], place[2], first, last, scale, degree, rows)
                rest += _absorb(triangle, rows, filled, columns)
            first, most = last, options
            while most > 0 and last < TERMS_OF_DEGREE[most - 1] + SPARE_POINTS[most - 1]:
                most -= 1
            if most == 0 or reach == 0.0:
                continue
            if by_moments:
                _normal_equations(moments, products, TERMS_OF_DEGREE[most - 1], equations)
                _cholesky(equations, TERMS_OF_DEGREE[most - 1])
            known = equations if by_moments else triangle
            while most > 0 and not _determined(known, TERMS_OF_DEGREE[most - 1], scale / np.sqrt(reach)):
                most -= 1
            if most == 0:
                continue
            terms, over = TERMS_OF_DEGREE[most - 1], rest
            if by_moments:
                for j in range(terms):
                    heights[j], inverse[j] = equations[j, HEIGHTS_AT], equations[j, IDENTITY_AT : IDENTITY_AT + 6]
                    over -= heights[j] ** 2
                over = max(over, 0.0)
            else:
                _invert(triangle, terms, inverse)
                heights[:columns] = triangle[columns, :columns]
                for j in range(terms, columns):
                    over += heights[j] ** 2
            _nested(inverse, heights, terms, coefficients, variances)
            for d in range(most - 1, -1, -1):
                for j in range(TERMS_OF_DEGREE[d], terms):
                    over += heights[j] ** 2
                terms = TERMS_OF_DEGREE[d]
                factors[m, s, d] = np.sqrt(variances[d]) / (scale * scale)
                _weingarten(coefficients[d], scale, bends[m] * scale, operators[m, s, d])
                slopes[m, s, d] = coefficients[d, 1:3]
                rests[m, s, d] = np.sqrt(over / (last - terms)) * scale
    return operators, factors, rests, slopes


@njit(cache=True, nogil=True)
def pooled_bias(operators, deviations, pools, reaches, sizes, certainty, out):  # type: ignore[no-untyped-def]
    """Squared bias of every candidate, from its disagreement with less biased ones around each point.

    The variance of the difference of two nested fits is the difference of their variances if the wider one is
    unbiased (Hausman): what exceeds it on average over the pool, and `certainty` standard deviations of that
    average, is bias. Fits side by side share their noise, and the bias of a wide one changes slowly, over its own
    width: it is judged by a pool as wide as itself, which holds more of what is independent.

    Args:
        operators: (N, S, D, 3) of `fit_jets`.
        deviations: (N, S, D) their standard deviations, infinite where undetermined.
        pools: (M, L, P) indices of points around each of M points, in L pools of growing reach.
        reaches: (L,) nearest points among which the members of each pool are; each judges the sizes from its reach on,
            the first all below, too.
        sizes: (S,) neighbourhood sizes.
        certainty: standard deviations.
        out: (M, S, D) squared Frobenius norms, written.
    """
    options, pool, levels = operators.shape[2], pools.shape[2], pools.shape[1]
    # of the pool's points side by side: variances, NaN where undetermined and where a row is filled up, and operators
    row = -(-pool // (2 * FILLED_UP_TO)) * 2 * FILLED_UP_TO
    variances, parts = np.full((len(sizes), options, row), np.nan), np.zeros((len(sizes), options, 3, row))
    for m in range(len(pools)):
        level = -1
        for s in range(len(sizes)):
            while level + 1 < levels and (level < 0 or reaches[level + 1] <= sizes[s]):
                level += 1
                last = s  # of the sizes that are judged by this pool
                while last + 1 < len(sizes) and (level + 1 == levels or sizes[last + 1] < reaches[level + 1]):
                    last += 1
                for i in range(pool):
                    y = pools[m, level, i]
                    for size in range(min(last + 2, len(sizes))):
                        for d in range(options):
                            sd = deviations[y, size, d]
                            variances[size, d, i] = sd * sd if np.isfinite(sd) else np.nan
                            for k in range(3):
                                parts[size, d, k, i] = operators[y, size, d, k]
            for d in range(options):
                worst = 0.0
                for other in range(min(s + 2, len(sizes))):
                    for higher in range(d, options):
                        # one size wider serves as a judge only if its degree is higher
                        if higher == d and other >= s:
                            continue
                        excess, weight, members = _disagreement(variances, parts, s, d, other, higher)
                        own, its = variances[s, d, 0], variances[other, higher, 0]
                        if own >= 0.0 and its >= 0.0 and (other > s or its > own):
                            # beyond what noise does at one point, its own gap needs no company
                            expected = max(its + (own if other > s else -own), LEAST_SQUARED_ERROR)
                            worst = max(worst, _gap(parts, s, d, other, higher, 0) - CERTAIN_GAP * expected)
                        if excess > worst * weight:  # else nothing is above the worst, whatever the allowance
                            # neighbourhoods overlap: the pool holds fewer independent values than points
                            independent = 1.0 + INDEPENDENT_SHARE * reaches[level] * (members - 1.0) / (
                                pool * sizes[other]
                            )
                            allowance = certainty * np.sqrt(2.0 * members / (3.0 * independent * weight))
                            worst = max(worst, excess / weight - allowance)
                out[m, s, d] = worst


@njit(cache=True, inline="always")
def _gap(parts, s, d, other, higher, i):  # type: ignore[no-untyped-def]
    """Squared Frobenius norm of the difference of two of point i's symmetric operators."""
    a = parts[s, d, 0, i] - parts[other, higher, 0, i]
    b = parts[s, d, 1, i] - parts[other, higher, 1, i]
    c = parts[s, d, 2, i] - parts[other, higher, 2, i]
    return a * a + 2.0 * b * b + c * c


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _disagreement(variances, parts, s, d, other, higher):  # type: ignore[no-untyped-def]
    """Sums over a pool of a fit's weighed gaps from another beyond the expected ones, of the weights, and of members.

    The weight is one over the variance of the gap: one uncertain judge must not drown the others. The other fit is a
    judge where it varies more, or is wider.
    """
    excess, weight, members, sign = 0.0, 0.0, 0.0, 1.0 if other > s else -1.0
    for i in range(variances.shape[2]):
        own, its = variances[s, d, i], variances[other, higher, i]
        known = own + its >= 0.0 and (sign > 0.0 or its > own)
        expected = max(its + sign * own, LEAST_SQUARED_ERROR)
        share = 1.0 / (expected * expected)
        beyond = (_gap(parts, s, d, other, higher, i) - expected) * share
        excess += beyond if known else 0.0
        weight += share if known else 0.0
        members += 1.0 if known else 0.0
    return excess, weight, members


@njit(cache=True, nogil=True)
def judged_means(weights, operators, factors, rests, noise, sizes, out):  # type: ignore[no-untyped-def]
    """Variance of weighed means of nested fits, and what their bias is judged by (theory equations 9.4 and 9.4a).

    A fit of degree d is biased as its reach to the power d, so as its size n to d/2: of its difference from the fit
    over m points, 1/((m/n)^(d/2) - 1) is its own bias. The judge is wider where there is one, which has less noise; a
    fit without any is trusted no better than what it leaves over.

    Args:
        weights: (M, S, D) of the means, none where a fit is not determined.
        operators, factors, rests: of `fit_jets` at the M points.
        noise: standard deviation of the points.
        sizes: (S,) neighbourhood sizes.
        out: (M, 3) written: variance by the noise; squared Frobenius norm of the estimated bias less what noise adds to
            it; what noise of the size of the residuals would add.
    """
    count, options = len(sizes), weights.shape[2]
    own, bias = np.empty(count * options), np.empty(count * options)
    level, rest = np.empty(count * options), np.empty(count * options)
    for m in range(len(weights)):
        bias[:] = 0.0
        level[:] = 0.0
        rest[:] = 0.0
        a, b, c = 0.0, 0.0, 0.0
        for s in range(count):
            for d in range(options):
                i = s * options + d
                own[i] = weights[m, s, d]
                if np.isfinite(factors[m, s, d]):
                    level[i] = (noise * factors[m, s, d]) ** 2
                    rest[i] = (max(noise, rests[m, s, d]) * factors[m, s, d]) ** 2
        for s in range(count):
            for d in range(options):
                if not weights[m, s, d] > 0.0:
                    continue
                t = _judge(factors[m, :, d], s)
                if t == s:
                    level[s * options + d] = rest[s * options + d]
                    continue
                share = weights[m, s, d] / ((sizes[t] / sizes[s]) ** (d + 1) - 1.0)
                a += share * (operators[m, t, d, 0] - operators[m, s, d, 0])
                b += share * (operators[m, t, d, 1] - operators[m, s, d, 1])
                c += share * (operators[m, t, d, 2] - operators[m, s, d, 2])
                bias[t * options + d] += share
                bias[s * options + d] -= share
        out[m, 0] = _nested_variance(own, level)
        out[m, 1] = a * a + 2.0 * b * b + c * c - _nested_variance(bias, level)
        out[m, 2] = _nested_variance(bias, rest)


@njit(cache=True)
def _judge(factors, s):  # type: ignore[no-untyped-def]
    """The size by which the fit over size s is judged: up to two sizes wider, else up to two narrower, else s."""
    for t in range(min(s + JUDGE_STEPS, len(factors) - 1), s, -1):
        if np.isfinite(factors[t]):
            return t
    for t in range(max(s - JUDGE_STEPS, 0), s):
        if np.isfinite(factors[t]):
            return t
    return s


@njit(cache=True)
def _nested_variance(shares, variances):  # type: ignore[no-untyped-def]
    """Variance of a sum of nested fits (K,), each times its share of either sign.

    The fits share their points: the more exact of two nested least-squares fits is the better one with less of the
    other's noise in it, and their covariance is its variance (Hausman). So this is the sum over all pairs of
    c_i c_j min(v_i, v_j).
    """
    order = np.argsort(variances)
    behind, total = 0.0, 0.0
    for k in range(len(order) - 1, -1, -1):
        i = order[k]
        total += shares[i] * variances[i] * (shares[i] + 2.0 * behind)
        behind += shares[i]
    return total
