"""The extent of a fitted base: the part that the finger felt, without what lies beyond the body's edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface, SurfaceError, Trace
from mapping.base.base import Base, Feet
from mapping.base.cells import Cells
from mapping.base.fit import fit_base
from mapping.base.laid_trace import LaidTrace
from mapping.base.robust import robust_scale

MOST_EXTENT_CELLS = 4000
# Stretches that are laid on the base to find where the trace leaves it
MOST_BORDER_CELLS = 4000
# So far from a place where the finger felt nothing, or rolled off, the body is taken to go on, in tip radii
EDGE_REACH = 0.5
# Cosine of the angle to the side from which a face is felt, at most
FELT_SIDE_COSINE = 0.5
# A sweep that ends this deep (tip radii) below the base rolled off the body's edge
ROLLED_OFF = 0.05
# A ball that overlaps the base by so much (tip radii) would have felt it: half of what sweeps are pressed by
FELT_OVERLAP = 0.01
# A centre this far off the base's normal (rad) stands beside the base, not over it
BESIDE_BASE_ANGLE = float(np.radians(5.0))
# Barycentric coordinate below which a foot stands on a side
ON_SIDE = 1e-6
# Triangles that sweeps are planned on, and how far a better fit may lie from the first, in tip radii
BASE_TRIANGLE_SIZE, AWAY = 0.5, 0.5


def touched_part(base: Base, trace: Trace, empty: FloatArray, box: FloatArray, sides: FloatArray) -> Base:
    """The faces of a base inside a box whose nearest known place was touched, and that stay clear of empty ones.

    What faces away from all sides is left out as well: a body that stands on a table is not felt from below.

    Args:
        base: as fitted, larger than the body.
        trace: what was felt. Where a sweep rolled off an edge counts as empty.
        empty: (M, 6) places of ball centres where nothing was felt, m, and the outward directions that they were
            pressed against; those clear of the base, and those beside steep flanks of it, tell nothing.
        box: (2, 3) low and high corners, m.
        sides: (S, 3) outward directions of the sides from which the body may be felt.

    Raises:
        SurfaceError: nothing is left.
    """
    from scipy.spatial import cKDTree

    cells = Cells.of(trace, MOST_EXTENT_CELLS)
    feet = base.foot(cells.centers, trace.tip_radius)
    off = rolled_off(feet.height, cells.sweep, trace.tip_radius)
    bare = _bare(base, empty, trace.tip_radius)
    places = np.concatenate([feet.points, bare])
    touched = np.concatenate([~off, np.zeros(len(bare), dtype=bool)])
    middle = base.surface.vertices[base.surface.faces].mean(axis=1)
    _, nearest = cKDTree(places).query(middle)
    keep = touched[nearest]
    if not touched.all():
        keep &= cKDTree(places[~touched]).query(middle)[0] > EDGE_REACH * trace.tip_radius
    keep &= (base.surface.face_normals @ sides.T > FELT_SIDE_COSINE).any(axis=1)
    keep = keep & (middle >= box[0]).all(axis=1) & (middle <= box[1]).all(axis=1)
    if not keep.any():
        raise SurfaceError(
            "no part of the fitted base lies inside the region and faces the sides it is felt from; is the region "
            "where the body is?"
        )
    return part_of(base, keep)


def rolled_off(height: FloatArray, sweep: IntArray, tip_radius: float) -> BoolArray:
    """(N,) True for the ends of sweeps that sink ever deeper: there the ball rolls off the body's edge."""
    off = np.zeros(len(height), dtype=bool)
    low = -3.0 * robust_scale(height) - 1e-3 * tip_radius
    for number in np.unique(sweep):
        own = np.flatnonzero(sweep == number)
        for order in (own, own[::-1]):
            below = height[order] < low
            run = order[: len(order) if below.all() else int(np.argmin(below))]
            if len(run) and height[run].min() < -ROLLED_OFF * tip_radius:
                off[run] = True
    return off


def over_base(trace: Trace, base: Base) -> BoolArray:
    """(N,) True where the ball's centre stands over the base, False where it stands beyond its border.

    Of a trace of many samples the means of short stretches are laid on the base; its single samples only next to
    stretches of the other sort.
    """
    laid = LaidTrace.of(trace, base)
    if len(trace) <= MOST_BORDER_CELLS:
        return ~_beyond(base, laid.feet())
    cells = Cells.of(trace, MOST_BORDER_CELLS)
    beyond = _beyond(base, base.foot(cells.centers, trace.tip_radius))
    change = np.flatnonzero(np.diff(beyond, prepend=beyond[0]) | np.diff(cells.sweep, prepend=cells.sweep[0] - 1))
    doubtful = np.zeros(len(beyond), dtype=bool)
    doubtful[np.clip((change[:, None] + [-1, 0]).ravel(), 0, len(beyond) - 1)] = True
    over, index = ~beyond[cells.cell], np.flatnonzero(doubtful[cells.cell])
    over[index] = ~_beyond(base, laid.feet(index))
    return over


def _beyond(base: Base, feet: Feet) -> BoolArray:
    """(N,) True of what stands aslant over the base's border."""
    aslant = np.abs((feet.normals * base.surface.face_normals[feet.face]).sum(axis=1)) < np.cos(BESIDE_BASE_ANGLE)
    at_side = (feet.barycentric < ON_SIDE) & base.surface.open_sides[feet.face]
    return np.asarray(aslant & at_side.any(axis=1))


def refined(base: Base, trace: Trace) -> Base:
    """A base that was found by feeling, fitted again to all that was felt over it, as far as it reached before.

    It stays as it was if the new fit comes no nearer to half of the places.
    """
    over = trace.select(over_base(trace, base))
    again = fit_base(over, spacing=BASE_TRIANGLE_SIZE * trace.tip_radius)
    centers = Cells.of(over, MOST_EXTENT_CELLS).centers
    missed = [float(np.median(np.abs(each.foot(centers, trace.tip_radius).height))) for each in (base, again)]
    if missed[1] > missed[0]:
        return base
    middle = again.surface.vertices[again.surface.faces].mean(axis=1)
    feet = base.foot(middle, trace.tip_radius)
    near = np.abs(feet.height + trace.tip_radius) < AWAY * trace.tip_radius
    keep = near & ~_beyond(base, feet)
    if not keep.any():
        return base
    return part_of(replace(again, missed=base.missed), keep)


def _bare(base: Base, empty: FloatArray, tip_radius: float) -> FloatArray:
    """Points (K, 3) of the base that the ball would have touched where it felt nothing."""
    if not len(empty):
        return np.zeros((0, 3))
    free = base.foot(empty[:, :3], tip_radius)
    facing = (base.surface.face_normals[free.face] * empty[:, 3:]).sum(axis=1) > FELT_SIDE_COSINE
    return np.asarray(free.points[facing & (free.height < -FELT_OVERLAP * tip_radius)])


def part_of(base: Base, keep: BoolArray) -> Base:
    """Some of a base's faces (F,)."""
    used, faces = np.unique(base.surface.faces[keep], return_inverse=True)
    return replace(base, surface=Surface(base.surface.vertices[used], faces.reshape(-1, 3)))
