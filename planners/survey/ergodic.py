"""Ergodic sweeps: the finger follows the heat of what it has not visited yet; a baseline that looks at nothing felt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import Base
from mapping.detection import face_samples
from planners import Outcome, Plan
from planners.paths import Strokes, tangential

# Distance of the places that visits are counted at, in footprints; steps of one sweep
VISIT_SPACING, STEPS_PER_SWEEP = 0.7, 24
# Decay length of the potential, in sizes of the body
RANGE = 0.5


@dataclass(frozen=True, eq=False, kw_only=True)
class Ergodic:
    """Coverage whose time average tends to a uniform density over the surface, by the potential of heat.

    Places evenly spread over the body count how often the finger was near. What lags behind the uniform density is
    a source of heat; the steady temperature with some loss to the surroundings is solved on the places' graph, and
    the finger climbs its gradient at a constant speed.

    Args:
        base: the body.
        tip_radius: m.
        seconds: duration, s.
        footprint: radius within which a visit counts, m; None: half a tip radius.
        speed, force: of the sweeps, m/s and N.

    Reference: Ivić, Crnković and Mezić, Ergodicity-based cooperative multiagent area coverage via a potential
    field, 2017 (HEDAC); Bilaloglu, Löw and Calinon, Tactile ergodic coverage on curved surfaces, 2025.
    """

    base: Base
    tip_radius: float
    seconds: float
    footprint: float | None = None
    speed: float = 0.03
    force: float = 1.0

    def plan(self, rng: np.random.Generator) -> Plan:
        """Sweeps of 24 steps until the time is spent; only the first place is random."""
        from scipy.spatial import cKDTree

        reach = 0.5 * self.tip_radius if self.footprint is None else self.footprint
        places = even_places(self.base, VISIT_SPACING * reach)
        tree = cKDTree(places)
        warm = steady_heat(places, VISIT_SPACING * reach, RANGE * self.base.surface.size)
        visits = np.zeros(len(places))
        strokes = Strokes(self.base, self.tip_radius, self.speed, self.force)
        here, normal = strokes.onto(places[rng.integers(len(places))])
        ahead = tangential(rng.standard_normal(3), normal)
        spent = 0.0
        while spent < self.seconds:
            points, normals = [here], [normal]
            for _ in range(STEPS_PER_SWEEP):
                _visit(visits, places, tree.query_ball_point(here, 2.0 * reach), here, reach)
                lag = np.maximum(1.0 / len(places) - visits / max(visits.sum(), np.finfo(float).tiny), 0.0) ** 2
                near = tree.query_ball_point(here, 2.5 * reach)
                ahead = _uphill(warm(lag)[near], places[near] - here, normal, ahead)
                here, normal = strokes.onto(here + 0.5 * reach * ahead)
                points.append(here)
                normals.append(normal)
            move = strokes.over(np.array(points), np.array(normals))
            if move.length == 0:
                return Outcome("lost", "the gradient leads off the body")
            spent += move.duration
            yield move
        return Outcome("done")


def even_places(base: Base, spacing: float) -> FloatArray:
    """Points (N, 3) of the surface, one for each cell of a cubic grid that it passes, m."""
    points = face_samples(base.surface, 0.5 * spacing).points
    cell = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    _, index, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    means = np.column_stack([np.bincount(index, weights=points[:, k]) for k in range(3)]) / count[:, None]
    return np.asarray(base.nearest.query(means).points)


def steady_heat(places: FloatArray, spacing: float, decay: float) -> Callable[[FloatArray], FloatArray]:
    """The map from heat sources (N,) at the places to the steady temperature (N,) there.

    (1 + decay^2 L) u = s with the graph Laplacian L of neighbouring places, factored once.
    """
    from scipy.sparse import coo_matrix, diags, identity
    from scipy.sparse.linalg import splu
    from scipy.spatial import cKDTree

    pairs = cKDTree(places).query_pairs(2.0 * spacing, output_type="ndarray")
    square = ((places[pairs[:, 0]] - places[pairs[:, 1]]) ** 2).sum(axis=1)
    weight = np.exp(-square / spacing**2)
    count = len(places)
    half = coo_matrix((weight, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    links = (half + half.T).tocsr()
    degree = np.asarray(links.sum(axis=1)).ravel()
    # the sum of w d^2 / 4 over the neighbours turns the graph's Laplacian into the surface's
    scale = 4.0 * count / max(float(2.0 * (weight * square).sum()), np.finfo(float).tiny)
    operator = identity(count) + decay**2 * scale * (diags(degree) - links)
    solve: Callable[[FloatArray], FloatArray] = splu(operator.tocsc()).solve
    return solve


def _visit(visits: FloatArray, places: FloatArray, near: list[int], here: FloatArray, reach: float) -> None:
    visits[near] += np.exp(-0.5 * ((places[near] - here) ** 2).sum(axis=1) / (0.5 * reach) ** 2)


def _uphill(heat: FloatArray, offset: FloatArray, normal: FloatArray, ahead: FloatArray) -> FloatArray:
    """Unit direction (3,) in which the temperature of places at some offsets (M, 3) rises; `ahead` if none."""
    if len(heat) < 3:
        return tangential(ahead, normal)
    side = np.cross(normal, ahead)
    design = np.column_stack([np.ones(len(heat)), offset @ ahead, offset @ side])
    _, along, across = np.linalg.lstsq(design, heat - heat.mean(), rcond=None)[0]
    way = along * ahead + across * side
    return tangential(way if np.linalg.norm(way) > 0 else ahead, normal)
