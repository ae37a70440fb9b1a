"""Meshes of features: tubes or swells along ridges, caps or bells on bumps, ribbons in hollows, on steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, IntArray, Interval, Surface
from mapping.base import tangent_frame
from mapping.geometry.mesh import directions
from mapping.inference.families import width_at_half_height
from mapping.inference.kinds import RIBBON_LIFT, SECTION_CORNERS, kind_of

# A bell is drawn down to this share of its height.
DRAWN_BELL_SHARE = 0.03


def feature_mesh(feature: Feature) -> Surface:
    """The feature's estimated body as a mesh on the base, m, object frame.

    Ridges and bumps are half ellipses of the median height and width, those whose flanks run out the bells that were
    fitted, grooves and pits flat ribbons and discs of the median width, steps walls of the median height: a picture of
    the record, not of the data.
    """
    height, width = _size(feature)
    if len(feature.axis) == 1:
        return _turned(feature, _meridian(feature, max(height, RIBBON_LIFT * width), width))
    section, closed = kind_of(feature).outline(height, width)
    if feature.details.exponent is not None and feature.height.median > 0.0:
        flank = _meridian(feature, height, width)
        section = np.vstack([flank[::-1], flank[1:] * [-1.0, 1.0]])
    return _sweep(feature, section, closed=closed)


def drawn_at_least(feature: Feature, size: float) -> Feature:
    """The feature with its width, and its height as far as it is in proportion, enlarged to `size`, m, to be seen."""
    height, width = _size(feature)
    extent = max(width, abs(height))
    if extent >= size or extent == 0.0:
        return feature
    factor = size / extent
    width, height = factor * width, factor * height
    return replace(feature, width=Interval(width, width, width), height=Interval(height, height, height))


def _size(feature: Feature) -> tuple[float, float]:
    """Median height and width, m; the larger stands in where the other is unknown or zero."""
    height, width = feature.height.median, feature.width.median
    height = height if np.isfinite(height) else 0.0
    width = width if np.isfinite(width) and width > 0 else max(abs(height), feature.position_sd)
    if feature.width.bounded:  # drawn no narrower than a bar as wide as high, if the bounds allow that
        width = max(width, min(abs(height), feature.width.high))
    return height, width


def _meridian(feature: Feature, height: float, width: float) -> FloatArray:
    """(M, 2) distances from the axis of a point feature and heights, m, from the crest down to the base."""
    p = feature.details.exponent
    if p is not None and feature.height.median > 0.0:
        share = np.linspace(0.0, 1.0, 2 * SECTION_CORNERS)
        # evenly spaced in the distance up to where the skirt is hardly higher than the base
        place = share * np.sqrt(p * np.expm1(-np.log(DRAWN_BELL_SHARE) / p))
        fall = (1.0 + place**2 / p) ** -p
        bell = np.column_stack([width / float(width_at_half_height(1.0, p)) * place, height * fall])
        return np.vstack([bell, [bell[-1, 0], 0.0]])
    polar = np.linspace(0.0, 0.5 * np.pi, SECTION_CORNERS // 2 + 1)
    return np.column_stack([0.5 * width * np.sin(polar), height * np.cos(polar)])


def _turned(feature: Feature, meridian: FloatArray) -> Surface:
    """The body of revolution of a meridian (M, 2) that begins on the axis, over the feature's point."""
    frame = tangent_frame(feature.normals[0], np.zeros(3))
    around = np.linspace(0.0, 2.0 * np.pi, 2 * SECTION_CORNERS)[:-1]
    radius, up = meridian[1:, :1], meridian[1:, 1:]
    local = np.stack(np.broadcast_arrays(radius * np.cos(around), radius * np.sin(around), up), axis=-1)
    points = np.concatenate([[[0.0, 0.0, meridian[0, 1]]], local.reshape(-1, 3)])
    ring, count = np.arange(len(around)), len(around)
    fan = np.column_stack([np.zeros_like(ring), 1 + ring, 1 + (ring + 1) % count])
    faces = [fan, *(_band(1 + i * count, 1 + (i + 1) * count, count) for i in range(len(meridian) - 2))]
    return Surface(feature.axis[0] + points @ frame, np.concatenate(faces))


def _band(first: int, second: int, count: int) -> IntArray:
    """Triangles between two rings of `count` vertices that begin at the given indices."""
    here = np.arange(count)
    there = (here + 1) % count
    lower = np.column_stack([first + here, second + here, second + there])
    upper = np.column_stack([first + here, second + there, first + there])
    return np.concatenate([lower, upper])


def _sweep(feature: Feature, section: FloatArray, *, closed: bool) -> Surface:
    """The section (M, 2), m (across, outward), moved along the axis; a closed axis gives a ring.

    `closed` sections form a tube, with flat ends unless the axis returns to its beginning.
    """
    axis = feature.axis[:-1] if feature.closed else feature.axis
    normals = feature.normals[: len(axis)]
    along = directions(feature.axis)[: len(axis)]
    frames = np.stack([tangent_frame(n, t) for n, t in zip(normals, along, strict=True)])
    # Looking along the tangent the binormal points to the left, so counter-clockwise sections face outward.
    across, outward = -frames[:, 1], frames[:, 2]
    points = axis[:, None] + section[:, 0, None] * across[:, None] + section[:, 1, None] * outward[:, None]
    size = len(section)
    corner = np.arange(size if closed else size - 1)
    beside = (corner + 1) % size
    legs = np.arange(len(axis) if feature.closed else len(axis) - 1)
    here, there = legs[:, None] * size, ((legs + 1) % len(axis))[:, None] * size
    lower = np.stack([here + corner, there + corner, there + beside], axis=-1).reshape(-1, 3)
    upper = np.stack([here + corner, there + beside, here + beside], axis=-1).reshape(-1, 3)
    faces = [lower, upper]
    if closed and not feature.closed:
        fan = np.column_stack([np.zeros(size - 2, dtype=np.int64), np.arange(1, size - 1), np.arange(2, size)])
        faces += [fan, (len(axis) - 1) * size + fan[:, ::-1]]
    return Surface(points.reshape(-1, 3), np.concatenate(faces))
