"""Compiled by numba: which face each pixel sees, and how light it is."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapping import FloatArray, IntArray

# Barycentric coordinates may miss zero by rounding: without this, pixels on an edge between two faces could see neither
EDGE_SLACK = 1e-9


@njit(cache=True)
def see(
    corners: FloatArray,
    faces: IntArray,
    pixel: float,
    depth: NDArray[np.float32],
    seen: NDArray[np.int32],
    pixels: NDArray[np.float32],
) -> None:
    """Fill depth (H, W), seen (H, W) and pixels (H, W, 3) with what the pixels see of faces (F, 3).

    A point of a face is a weighted mean of its corners; along a ray (x, y, 1) t the weights over t are linear in x and
    y (Olano and Greer, Triangle scan conversion using 2D homogeneous coordinates, 1997), so nothing must be clipped.

    Args:
        corners: (V, 3) vertices to the right, up and forward of the camera.
        pixel: size of a pixel at distance one.
        depth: along forward, inf where nothing is seen.
        seen: number of the face, -1 where none is.
        pixels: weights of the face's second and third corner, until they are shaded: there are millions.
    """
    height, width = depth.shape
    for face in range(len(faces)):
        a, b, c = corners[faces[face, 0]], corners[faces[face, 1]], corners[faces[face, 2]]
        # the rows of the inverse of the matrix with columns a, b, c, up to its determinant
        u = np.array([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
        v = np.array([c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]])
        w = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
        volume = a[0] * u[0] + a[1] * u[1] + a[2] * u[2]
        if volume == 0.0:
            continue  # seen edge on
        left, right, top, bottom = 0, width - 1, 0, height - 1
        if min(a[2], b[2], c[2]) > 0.0:
            low = min(a[0] / a[2], b[0] / b[2], c[0] / c[2]) / pixel + 0.5 * width - 0.5
            high = max(a[0] / a[2], b[0] / b[2], c[0] / c[2]) / pixel + 0.5 * width - 0.5
            lowest = 0.5 * height - 0.5 - max(a[1] / a[2], b[1] / b[2], c[1] / c[2]) / pixel
            highest = 0.5 * height - 0.5 - min(a[1] / a[2], b[1] / b[2], c[1] / c[2]) / pixel
            if high < 0 or low > width - 1 or highest < 0 or lowest > height - 1:
                continue
            left, right = max(left, int(np.floor(low))), min(right, int(np.ceil(high)))
            top, bottom = max(top, int(np.floor(lowest))), min(bottom, int(np.ceil(highest)))
        elif max(a[2], b[2], c[2]) <= 0.0:
            continue
        for row in range(top, bottom + 1):
            y = (0.5 * height - 0.5 - row) * pixel
            for column in range(left, right + 1):
                x = (column + 0.5 - 0.5 * width) * pixel
                first = (u[0] * x + u[1] * y + u[2]) / volume
                second = (v[0] * x + v[1] * y + v[2]) / volume
                third = (w[0] * x + w[1] * y + w[2]) / volume
                nearness = first + second + third
                slack = -EDGE_SLACK * abs(nearness)
                if nearness <= 0.0 or first < slack or second < slack or third < slack:
                    continue
                if nearness * depth[row, column] > 1.0:
                    depth[row, column] = 1.0 / nearness
                    seen[row, column] = face
                    pixels[row, column, 0] = second / nearness
                    pixels[row, column, 1] = third / nearness


@njit(cache=True)
def sums_of_alike(flat: FloatArray, weighted: FloatArray, face: IntArray, vertex: IntArray, alike: float) -> FloatArray:
    """(N, 3) sums, at each corner of a face, over the faces of its vertex whose normals' cosine with its own is larger.

    Args:
        flat, weighted: (F, 3) unit normals of the faces, and what is summed.
        face, vertex: (N,) whose each corner is; those of a vertex in a row.
    """
    sums = np.zeros((len(face), 3))
    first = 0
    for stop in range(1, len(face) + 1):
        if stop < len(face) and vertex[stop] == vertex[first]:
            continue
        for one in range(first, stop):
            own = flat[face[one]]
            for other in range(first, stop):
                its = flat[face[other]]
                if own[0] * its[0] + own[1] * its[1] + own[2] * its[2] > alike:
                    sums[one] += weighted[face[other]]
        first = stop
    return sums


@njit(cache=True)
def shade(
    seen: NDArray[np.int32],
    faces: IntArray,
    flat: FloatArray,
    bent: FloatArray,
    bends: IntArray,
    colours: FloatArray,
    light: FloatArray,
    rays: FloatArray,
    ambient: float,
    brightest: float,
    pixels: NDArray[np.float32],
) -> None:
    """Fill pixels (H, W, 3) by Lambert's law where a face is seen, with white elsewhere.

    Args:
        seen, pixels: of `see`.
        faces: (F, 3).
        flat: (F, 3) unit normals of the faces.
        bent, bends: (N, 3) normals at corners, and (F, 3) which of them each corner of a face has.
        colours: (V, 3).
        light: (3,) unit vector towards the light.
        rays: (3, 3) what a ray's direction changes by a pixel to the right, and by one down; and the first ray.
        ambient, brightest: share of the colour where no light falls, and where it falls straight.
    """
    height, width = seen.shape
    normal, ray = np.zeros(3), np.zeros(3)
    for row in range(height):
        for column in range(width):
            face = seen[row, column]
            if face < 0:
                pixels[row, column] = 1.0
                continue
            i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
            a, b, c = bends[face, 0], bends[face, 1], bends[face, 2]
            second, third = pixels[row, column, 0], pixels[row, column, 1]
            first = 1.0 - second - third
            size = 0.0
            facing = 0.0
            for axis in range(3):
                ray[axis] = rays[2, axis] + column * rays[0, axis] + row * rays[1, axis]
                facing += ray[axis] * flat[face, axis]
                normal[axis] = first * bent[a, axis] + second * bent[b, axis] + third * bent[c, axis]
                size += normal[axis] ** 2
            shine = 0.0
            if size > 0.0:
                side = -1.0 if facing > 0.0 else 1.0  # open surfaces are seen from both sides
                for axis in range(3):
                    shine += side * normal[axis] * light[axis] / np.sqrt(size)
            bright = ambient + (brightest - ambient) * min(max(shine, 0.0), 1.0)
            for axis in range(3):
                colour = first * colours[i, axis] + second * colours[j, axis] + third * colours[k, axis]
                pixels[row, column, axis] = min(max(colour * bright, 0.0), 1.0)


@njit(cache=True)
def outline(depth: NDArray[np.float32], step: float, darkness: float, pixels: NDArray[np.float32]) -> None:
    """Darken pixels (H, W, 3) where the depth (H, W) bends by more than `step` times itself: silhouettes."""
    height, width = depth.shape
    far = 0.0
    for row in range(height):
        for column in range(width):
            if depth[row, column] < np.inf:
                far = max(far, depth[row, column])
    far *= 1e3
    for row in range(height):
        for column in range(width):
            middle = depth[row, column]
            if middle == np.inf:
                continue
            bend = 0.0
            if 0 < row < height - 1:
                bend += abs(min(depth[row + 1, column], far) - 2 * middle + min(depth[row - 1, column], far))
            if 0 < column < width - 1:
                bend += abs(min(depth[row, column + 1], far) - 2 * middle + min(depth[row, column - 1], far))
            if bend > step * middle:
                for axis in range(3):
                    pixels[row, column, axis] *= darkness


@njit(cache=True)
def splat(
    column: FloatArray,
    row: FloatArray,
    place: FloatArray,
    colours: FloatArray,
    radius: float,
    bias: float,
    depth: NDArray[np.float32],
    pixels: NDArray[np.float32],
) -> None:
    """Draw discs of `radius` px around points, in pixels (H, W, 3), where nothing is more than `bias` in front.

    Args:
        column, row: (N,) px, NaN behind the camera; later points cover earlier ones.
        place: (N,) depth along forward.
        colours: (N, 3).
        depth: (H, W).
    """
    height, width = depth.shape
    reach = int(np.ceil(radius))
    for point in range(len(column)):
        if not (np.isfinite(column[point]) and np.isfinite(row[point])):
            continue
        if abs(column[point]) > 1e6 or abs(row[point]) > 1e6:
            continue
        middle_column, middle_row = int(np.rint(column[point])), int(np.rint(row[point]))
        front = place[point] - bias
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if dx * dx + dy * dy > radius * radius + 0.25:
                    continue
                i, j = middle_row + dy, middle_column + dx
                if 0 <= i < height and 0 <= j < width and front <= depth[i, j]:
                    for axis in range(3):
                        pixels[i, j, axis] = colours[point, axis]
