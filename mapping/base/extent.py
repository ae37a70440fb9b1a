"""The extent of a fitted base: the part that the finger felt, without what lies beyond the body's edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface, SurfaceError, Trace
from mapping.base.base import Base, Feet
from mapping.base.cells import Cells
from mapping.base.fit import fit_base
from mapping.base.laid_trace import LaidTrace
from mapping.geometry.mesh import FELT_SIDE_COSINE, faces_side
from mapping.instrument import robust_scale

MOST_EXTENT_CELLS = 4000
# Samples that are asked where a trace leaves the base, at most: a survey of a body 40 tip radii across, of as many
# sweeps, is 1600 radii of path, and asked every 0.8 of one; between two that answer differently every sample is asked
MOST_BORDER_SAMPLES = 2000
# Places by whose median two fits are compared: it is known to 1.25 / sqrt(1000) = 4 % of their scatter
MOST_FIT_PLACES = 1000
# So far from a place where the finger felt nothing, or rolled off, the body is taken to go on, in tip radii
EDGE_REACH = 0.5
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
# Distance along the path of samples that are asked where it leaves the base, in tip radii. A straight sweep that cuts a
# right corner off between two of them is half as far beyond the border at most: a triangle, by which that is known
BORDER_STEP = 2.0 * BASE_TRIANGLE_SIZE


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
    keep &= faces_side(base.surface.face_normals, sides)
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

    Of a trace of many samples some are laid on the base, and all between neighbours of which one stands beyond.
    """
    return _over_base(LaidTrace.of(trace, base))[0]


def _over_base(laid: LaidTrace) -> tuple[BoolArray, IntArray]:
    """Which samples (N,) stand over the base, and the indices of those that were asked first."""
    first = np.flatnonzero(np.diff(laid.sweep, prepend=-1))  # of each sweep
    step = max(1, -(-len(laid) // MOST_BORDER_SAMPLES))
    step *= max(1, int(BORDER_STEP * laid.tip_radius / max(_apart(laid, step), np.finfo(float).tiny)))
    asked = np.unique(np.concatenate([np.arange(0, len(laid), step), first, first[1:] - 1, np.arange(len(laid))[-1:]]))
    here = ~_beyond(laid.base, laid.feet(asked))
    over = np.repeat(here, np.diff(np.append(asked, len(laid))))
    differ = np.flatnonzero(here[1:] != here[:-1])
    differ = differ[laid.sweep[asked[differ]] == laid.sweep[asked[differ + 1]]]
    between = [np.arange(asked[k] + 1, asked[k + 1]) for k in differ]
    index = np.concatenate([np.zeros(0, dtype=np.int64), *between])
    if len(index):
        over[index] = ~_beyond(laid.base, laid.feet(index))
    return over, asked


def _apart(trace: Trace, step: int) -> float:
    """Mean distance of every step-th sample from the one before it in its sweep, m; 0 where there are none."""
    legs = np.linalg.norm(np.diff(trace.centers[::step], axis=0), axis=1)[np.diff(trace.sweep[::step]) == 0]
    return float(legs.mean()) if len(legs) else 0.0


def _beyond(base: Base, feet: Feet) -> BoolArray:
    """(N,) True of what stands aslant over the base's border."""
    aslant = np.abs((feet.normals * base.surface.face_normals[feet.face]).sum(axis=1)) < np.cos(BESIDE_BASE_ANGLE)
    at_side = (feet.barycentric < ON_SIDE) & base.surface.open_sides[feet.face]
    return np.asarray(aslant & at_side.any(axis=1))


def refined(base: Base, trace: Trace) -> Base:
    """A base that was found by feeling, fitted again to all that was felt over it, as far as it reached before.

    It stays as it was if the new fit comes no nearer to half of the places.
    """
    laid = LaidTrace.of(trace, base)
    over, asked = _over_base(laid)
    again = fit_base(trace.select(over), spacing=BASE_TRIANGLE_SIZE * trace.tip_radius, tested=False)
    compared = asked[over[asked]]
    compared = compared[:: -(-len(compared) // MOST_FIT_PLACES)]
    feet = laid.feet(compared), again.foot(trace.centers[compared], trace.tip_radius)
    missed = [float(np.median(np.abs(each.height))) for each in feet]
    if missed[1] > missed[0]:
        return base
    middle, reach = again.surface.vertices[again.surface.faces].mean(axis=1), AWAY * trace.tip_radius
    low, high = base.surface.bounds
    keep = ((middle >= low - reach) & (middle <= high + reach)).all(axis=1)
    below = base.foot(middle[keep], trace.tip_radius)
    near = np.abs(below.height + trace.tip_radius) < reach
    keep[keep] = near & ~_beyond(base, below)
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
