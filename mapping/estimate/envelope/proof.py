"""Proof: how far each estimated point may be off the body, from the positions of the balls alone (theory 4.8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray, read_only
from mapping.estimate.sweeps import unit
from mapping.geometry.mesh import BoxedPoints


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that touched the body, and what is known of where.

    Args:
        centers: (N, 3) m.
        sweep: (N,) number of the sweep; neighbours in one sweep bound each other.
        outward: (N, 3) directions that the contacts do not face: those in which the ball was free to leave.
        tip_radius: m.
        slack: by which two balls may overlap a contact of either, m.
        known: (N, 3) recorded contacts, m, or None if only positions are known.
    """

    centers: FloatArray
    sweep: IntArray
    outward: FloatArray
    tip_radius: float
    slack: float
    known: FloatArray | None = None

    def reach(
        self,
        points: FloatArray,
        owners: IntArray,
        spot: IntArray,
        faces: IntArray,
        across: FloatArray | None,
        enough: float,
    ) -> tuple[FloatArray, FloatArray]:
        """How far below each point (M, 3) its body may be, and how far above it may stand, (M,) each, m.

        Args:
            owners: (M, P) indices of the vertices whose balls are asked, the first first; -1 for none.
            spot: (V,) ball of each vertex, -1 where it has none that is known to touch.
            faces: (F, 3) a mesh of the vertices: balls are bounded by those beside them on it.
            across: (V, 3) directions across a lone sweep, whose contacts are taken to be in the plane of the sweep.
            enough: further balls of a point are not asked below this bound, m.
        """
        from mapping.estimate.envelope.proof_kernels import proven_reach, rings

        nothing, boxed = np.zeros((0, 3)), BoxedPoints(self.centers)
        starts, ring = rings(read_only(faces), len(spot))
        below, above = np.empty((2, len(points)))
        proven_reach(
            read_only(points),
            read_only(owners),
            read_only(spot),
            starts,
            ring,
            read_only(self.centers),
            boxed.points,
            boxed.boxes,
            read_only(self.sweep),
            read_only(unit(self.outward[np.maximum(spot, 0)])),
            read_only(nothing if across is None else across),
            float(self.tip_radius),
            float(self.slack),
            read_only(nothing if self.known is None else self.known),
            float(enough),
            below,
            above,
        )
        return below, above


def owners_along(sweep: IntArray, spot: IntArray) -> IntArray:
    """(V, 4) for vertices in the order of their sweeps: those with a ball of their own before and after, two each.

    A vertex with a ball of its own has itself first.
    """
    count, place, own = len(spot), np.arange(len(spot)), spot >= 0
    earlier = np.r_[-1, np.maximum.accumulate(np.where(own, place, -1))]  # the last before each place
    later = np.r_[np.minimum.accumulate(np.where(own, place, count)[::-1])[::-1], count]  # the first from each on
    first, second = earlier[1:], later[:-1]
    beyond = earlier[np.maximum(first, 0)], later[np.minimum(second + 1, count)]
    owners = np.column_stack([first, np.where(second == first, -1, second), *beyond])
    held = (owners >= 0) & (owners < count)
    held &= sweep[np.clip(owners, 0, count - 1)] == sweep[:, None]
    return np.asarray(np.where(held, owners, -1))
