"""The posteriors of features about a point of the base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mapping import Feature, FloatArray
from mapping.inference.families import PosteriorProblem, Sizes, Spot, Surroundings, spot_at, window_for
from mapping.inference.kinds.kind import Kind, sizes_of
from mapping.inference.kinds.posterior_density import pose
from mapping.inference.likelihood import Shape, Window
from mapping.inference.sampler import find_optima

# A position across the sweeps is asked for only if they spread over this share of the disturbance.
SPREAD = 0.1


class PointShape(Shape, Protocol):
    """A shape about a spot: its first `free` parameters are its place in the tangent plane."""

    @property
    def window(self) -> Window: ...

    @property
    def spot(self) -> Spot: ...

    @property
    def free(self) -> int: ...

    @property
    def tip_radius(self) -> float: ...


@dataclass(frozen=True, eq=False)
class Seen:
    """What a point feature's shape is made from: window, spot, preliminary sizes, tip radius (m), free coordinates."""

    window: Window
    spot: Spot
    sizes: Sizes
    tip_radius: float
    free: int


def seen_about(feature: Feature, around: Surroundings, window: Window | None = None) -> Seen:
    """The window about a feature's point, if none is given, and whether the sweeps tell where across them it lies."""
    tip = around.trace.tip_radius
    sizes = sizes_of(feature, tip)
    point, normal = feature.axis[:1], feature.normals[:1]
    if window is None:
        window = window_for(point + tip * normal, normal, sizes, around)
    middle = int(np.argmin(np.linalg.norm(window.feet - point, axis=1)))
    spot = spot_at(point[0], normal[0], window.tangents[middle], around.base, tip, sizes.half_width)
    free = 2 if np.ptp((window.feet - spot.point) @ spot.axes[1]) > SPREAD * sizes.half_width else 1
    return Seen(window, spot, sizes, tip, free)


class PointKind(Kind):
    """A kind about a point: it gives the shape, and what the first guess of its last parameter may be instead."""

    @property
    def sampled(self) -> bool:
        return True

    def shape(self, seen: Seen) -> PointShape:
        """The family of shapes about a spot."""
        raise NotImplementedError(f"{type(self).__name__} gives no shape")

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        """Further values of the last parameter, from which the search for the optimum begins as well."""
        return ()

    def shape_on(self, window: Window, feature: Feature, around: Surroundings) -> PointShape:
        """The family about a feature's point, over any window."""
        return self.shape(seen_about(feature, around, window))

    def problem(self, feature: Feature, around: Surroundings) -> PosteriorProblem:
        """About the place of the optimum: from where it was detected the base is known to second order only."""
        seen = seen_about(feature, around)
        detected = self._posed(feature, seen, around)
        best, spot = find_optima(detected.target, detected.beginnings)[0], seen.spot
        place = np.zeros((1, 2))
        place[0, : seen.free] = best[: seen.free]
        point, normal = spot.lifted(place, np.zeros(1))[0], spot.normals(place)[0]
        reach = seen.sizes.half_width
        return self._posed(
            feature,
            replace(seen, spot=spot_at(point, normal, spot.axes[0], around.base, seen.tip_radius, reach)),
            around,
        )

    def _posed(self, feature: Feature, seen: Seen, around: Surroundings) -> PosteriorProblem:
        shape = self.shape(seen)
        return pose(feature, seen.sizes, shape, seen.window, around, self.beginnings(shape, seen.sizes))

    def beginnings(self, shape: PointShape, sizes: Sizes) -> FloatArray:
        """Starts that differ in place and in what the first guess knows least."""
        starts = [shape.start]
        for shift in (-0.5, 0.5):
            moved = shape.start.copy()
            moved[0] += shift * sizes.half_width
            starts.append(moved)
        for value in self.other_starts(sizes):
            other = shape.start.copy()
            other[-1] = value
            starts.append(other)
        return np.array(starts)
