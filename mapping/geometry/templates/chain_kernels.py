"""Compiled heights of a ball over many capsule chains at once (the exact envelope of shapes.chain_height)."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray

NO_ROOT = -1e300
# Share by which the ball and the chain are taken for larger where a bound leaves something out: what it leaves out does
# not change the last digit
BOUND_MARGIN = 1e-9


@njit(cache=True, error_model="numpy", inline="always")
def _last_exit(square, along, gap):  # type: ignore[no-untyped-def]
    """Largest root of square t^2 + 2 along t + gap = 0, or NO_ROOT; for along > 0 in the form that does not cancel."""
    discriminant = along * along - square * gap
    if discriminant < 0.0 or square < 1e-300:
        return NO_ROOT
    root = np.sqrt(discriminant)
    if along > 0.0:
        return -gap / (along + root)
    return (root - along) / square


@njit(cache=True, error_model="numpy", nogil=True)
def chain_heights(
    feet: FloatArray,
    normals: FloatArray,
    tangents: FloatArray,
    half_bin: FloatArray,
    first: IntArray,
    last: IntArray,
    chains: FloatArray,
    radii: FloatArray,
    rounding: FloatArray,
    tip_radius: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W chains (W, K, 3) over n bins, averaged over each bin; written to `out`.

    Bin i looks at the vertices first[i] to last[i] alone (a single one is a sphere), and at what the ball touches where
    it stands on the base: what it would meet further out does not lift it. A capsule is convex: where the
    ray leaves its infinite cylinder beyond a joint, it leaves the capsule through that joint's sphere. Both ends of
    the chain are rounded over by e = rounding * a: 1 is a capsule's hemisphere, 0 is cut square. At x beyond an end
    the dilated body then has the radius a - e + sqrt((r + e)^2 - x^2).

    The floor at 0 is averaged over the bin: a straight flank that changes by 2 d over it gives (s + d)^2 / (4 d)
    where it crosses 0.
    """
    walkers, bins = out.shape
    legs = chains.shape[1] - 1
    mean, astray = _mean_chain(chains)
    apart, nearest = _distances(feet, normals, first, last, mean, tip_radius)
    unit, length = np.zeros((max(legs, 1), 3)), np.zeros(max(legs, 1))
    for w in range(walkers):
        chain = chains[w]
        total = radii[w] + tip_radius
        edge = rounding[w] * radii[w]
        inner, reach = radii[w] - edge, tip_radius + edge
        first_leg, last_leg = legs, -1
        for k in range(legs):
            for c in range(3):
                unit[k, c] = chain[k + 1, c] - chain[k, c]
            length[k] = np.sqrt(unit[k, 0] ** 2 + unit[k, 1] ** 2 + unit[k, 2] ** 2)
            if length[k] > 0.0:
                first_leg, last_leg = min(first_leg, k), k
                for c in range(3):
                    unit[k, c] /= length[k]
        most_astray = astray[w].max()
        for i in range(bins):
            # all that the ball comes to within the bin, whichever leg it is nearest to
            around = (1.0 + BOUND_MARGIN) * (total + half_bin[i])
            if nearest[i] > most_astray + around and first_leg < last[i] and first[i] <= last_leg:
                out[w, i] = 0.0
                continue
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            qx = feet[i, 0] + tip_radius * nx
            qy = feet[i, 1] + tip_radius * ny
            qz = feet[i, 2] + tip_radius * nz
            # Further out than this the trace is below the base's over the whole bin.
            far = total * (total + 2.0 * half_bin[i])
            best, mx, my, mz = NO_ROOT, 0.0, 0.0, 0.0
            if last_leg < 0:
                start, stop = first[i], first[i] + 1
            else:
                start = min(max(first[i], first_leg), last_leg)
                stop = max(min(last[i] - 1, last_leg), start) + 1
            # the leg nearest to the bin comes first: what it gives tells of most others that they give less
            middle = min(max((first[i] + last[i]) // 2, start), stop - 1)
            for turn in range(stop - start):
                k = middle if turn == 0 else start + turn - (1 if start + turn <= middle else 0)
                if first[i] <= k < last[i] and apart[i, k - first[i]] > astray[w, k] + around:
                    continue
                joined = -1
                ox, oy, oz = qx - chain[k, 0], qy - chain[k, 1], qz - chain[k, 2]
                if last_leg >= 0:
                    if length[k] == 0.0:
                        continue
                    ux, uy, uz = unit[k, 0], unit[k, 1], unit[k, 2]
                    o_along = ox * ux + oy * uy + oz * uz
                    n_along = nx * ux + ny * uy + nz * uz
                    toward, square = ox * nx + oy * ny + oz * nz, ox * ox + oy * oy + oz * oz
                    along = toward - o_along * n_along
                    # most bins are far from most legs: they are told by the cheapest form, which cancels a little
                    if along > 0.0 and square - o_along * o_along > far:
                        continue
                    # what the ball would only meet further out does not lift it, whatever stands there
                    beside = min(max(o_along, 0.0), length[k])
                    if toward < beside * n_along and square - beside * (2.0 * o_along - beside) > total * total:
                        continue
                    if best > NO_ROOT:
                        # the leg lies in an endless cylinder: where the ray is past the middle of that, and out of it,
                        # when it has come as far as the best, the leg gives less
                        at, passed = o_along + best * n_along, toward + best
                        gap = square + best * (toward + passed) - at * at
                        if passed > at * n_along and gap > (1.0 + BOUND_MARGIN) * total * total:
                            continue
                    ax, ay, az = ox - o_along * ux, oy - o_along * uy, oz - o_along * uz
                    bx, by, bz = nx - n_along * ux, ny - n_along * uy, nz - n_along * uz
                    along = ax * bx + ay * by + az * bz
                    square = bx * bx + by * by + bz * bz
                    distance = ax * ax + ay * ay + az * az
                    distance = np.sqrt(distance)
                    t = _last_exit(square, along, (distance - total) * (distance + total))
                    place = o_along + max(t, -total) * n_along
                    if place >= 0.0 and place <= length[k]:
                        if t > best:
                            best, mx, my, mz = t, ax + t * bx, ay + t * by, az + t * bz
                        continue
                    if rounding[w] < 1.0 and (
                        (place < 0.0 and k == first_leg) or (place > length[k] and k == last_leg)
                    ):
                        x = 0.0
                        # A ray that leans along the axis changes x on its way: a few rounds settle it.
                        for _ in range(4):
                            x = -place if place < 0.0 else place - length[k]
                            if x >= reach:
                                t = NO_ROOT
                                break
                            size = inner + np.sqrt((reach - x) * (reach + x))
                            t = _last_exit(square, along, (distance - size) * (distance + size))
                            if t == NO_ROOT or abs(n_along) < 1e-12:
                                break
                            place = o_along + t * n_along
                        if t > best:
                            cx, cy, cz = ax + t * bx, ay + t * by, az + t * bz
                            share = 1.0 - inner / max(np.sqrt(cx * cx + cy * cy + cz * cz), inner)
                            x = -x if place < 0.0 else x
                            best, mx, my, mz = t, share * cx + x * ux, share * cy + x * uy, share * cz + x * uz
                        continue
                    beyond = place > length[k]
                    if beyond:
                        ox, oy, oz = qx - chain[k + 1, 0], qy - chain[k + 1, 1], qz - chain[k + 1, 2]
                    joined = k + 1 if beyond else k - 1
                along = ox * nx + oy * ny + oz * nz
                distance = ox * ox + oy * oy + oz * oz
                if distance > (far if along > 0.0 else total * total):
                    continue
                gap = distance + best * (2.0 * along + best)
                if best > NO_ROOT and along + best > 0.0 and gap > (1.0 + BOUND_MARGIN) * total * total:
                    continue
                distance = np.sqrt(distance)
                t = _last_exit(1.0, along, (distance - total) * (distance + total))
                if t <= best:
                    continue
                sx, sy, sz = ox + t * nx, oy + t * ny, oz + t * nz
                if rounding[w] < 1.0 and start <= joined and joined < stop:
                    # half of a joint's sphere is in the leg beside it, unless that ends there, cut square; where this
                    # bin does not look at that leg the sphere is all that stands for it
                    into = sx * unit[joined, 0] + sy * unit[joined, 1] + sz * unit[joined, 2]
                    if (into if joined > k else -into) > 0.0:
                        continue
                best, mx, my, mz = t, sx, sy, sz
            if best <= -half_bin[i]:
                out[w, i] = 0.0
                continue
            rise = mx * nx + my * ny + mz * nz
            run = abs(mx * tangents[i, 0] + my * tangents[i, 1] + mz * tangents[i, 2])
            # Near the horizon of the chain the flank is vertical; the slope of 45 degrees is steep enough there.
            d = half_bin[i] * (run / rise if run < rise else 1.0)
            if best >= d:
                out[w, i] = best
            elif best <= -d:
                out[w, i] = 0.0
            else:
                out[w, i] = (best + d) * (best + d) / (4.0 * d)


@njit(cache=True, error_model="numpy")
def _mean_chain(chains):  # type: ignore[no-untyped-def]
    """(K, 3) mean of W chains (W, K, 3), and (W, K) how far their legs, from each vertex to the next, are astray."""
    walkers, size = chains.shape[0], chains.shape[1]
    mean, astray = np.zeros((size, 3)), np.zeros((walkers, size))
    for w in range(walkers):
        for k in range(size):
            for c in range(3):
                mean[k, c] += chains[w, k, c] / walkers
    for w in range(walkers):
        for k in range(size):
            x, y, z = chains[w, k, 0] - mean[k, 0], chains[w, k, 1] - mean[k, 1], chains[w, k, 2] - mean[k, 2]
            off = np.sqrt(x * x + y * y + z * z)
            astray[w, k] = max(astray[w, k], off)
            if k > 0:
                astray[w, k - 1] = max(astray[w, k - 1], off)
    return mean, astray


@njit(cache=True, error_model="numpy")
def _distances(feet, normals, first, last, chain, tip_radius):  # type: ignore[no-untyped-def]
    """(n, L) distances of a ball that stands on the base from the legs first to last - 1 of a chain, (n,) the least.

    A ball that is further than both radii from an axis, and half a bin more, does not come to it within the bin.
    """
    bins, widest = len(feet), 1
    for i in range(bins):
        widest = max(widest, last[i] - first[i])
    out, nearest = np.full((bins, widest), -np.inf), np.where(last > first, np.inf, -np.inf)
    for i in range(bins):
        qx = feet[i, 0] + tip_radius * normals[i, 0]
        qy = feet[i, 1] + tip_radius * normals[i, 1]
        qz = feet[i, 2] + tip_radius * normals[i, 2]
        for k in range(first[i], last[i]):
            ox, oy, oz = qx - chain[k, 0], qy - chain[k, 1], qz - chain[k, 2]
            x, y, z = chain[k + 1, 0] - chain[k, 0], chain[k + 1, 1] - chain[k, 1], chain[k + 1, 2] - chain[k, 2]
            length = x * x + y * y + z * z
            share = min(max((ox * x + oy * y + oz * z) / length, 0.0), 1.0) if length > 0.0 else 0.0
            ox, oy, oz = ox - share * x, oy - share * y, oz - share * z
            out[i, k - first[i]] = np.sqrt(ox * ox + oy * oy + oz * oz)
            nearest[i] = min(nearest[i], out[i, k - first[i]])
    return out, nearest
