"""Kind: what the house asks of a kind of feature, and the table of all kinds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval, MappingError
from mapping.geometry.mesh import arclengths, nearest_on
from mapping.geometry.proxy import Part
from mapping.geometry.templates import contact_half_width, radius_of_cap
from mapping.inference.families import PosteriorProblem, Sizes, Surroundings
from mapping.inference.likelihood import Shape

# Every kind of feature: its name, and where it is made. A new one is one file and one line here. The benches draw from
# streams that are numbered in this order: a new one goes to the end.
KINDS: dict[str, str] = {
    "ridge": "mapping.inference.kinds.ridge:RIDGE",
    "bump": "mapping.inference.kinds.bump:BUMP",
    "groove": "mapping.inference.kinds.groove:GROOVE",
    "pit": "mapping.inference.kinds.pit:PIT",
    "step": "mapping.inference.kinds.step:STEP",
    "convex edge": "mapping.inference.kinds.edges:CONVEX_EDGE",
    "concave corner": "mapping.inference.kinds.edges:CONCAVE_CORNER",
}
# Corners of half a cross-section: smooth to the eye, light on disk
SECTION_CORNERS = 17
# A height that may be no more than nothing is looked for as if it were this share of the most that it may be: its
# disturbance would have no width, and places along its line no distance. Rasters over steps come out alike, and take
# as long within a tenth or two, at half and at twice as much
LEAST_OF_MOST = 0.1
# A ribbon stands this part of its width above the base, lest viewers show it in stripes
RIBBON_LIFT = 0.02

Colour = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Section:
    """What draws say of a feature's cross-section: its sizes, further details (fields of `Details`), and a remark."""

    height: Interval
    width: Interval
    details: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Kind:
    """A kind of feature.

    This class is the kind without a closed-form trace: it is reported as detected. One with a posterior says how it is
    posed (`problem`) and what its draws describe (`section`): see `PointKind` and `LineKind`.

    Args:
        name, plural: as people call it; the name is the one in `KINDS`.
        sign: +1 of what stands up, -1 of what is hollow, 0 of what has no side of its own.
        line: True if it lies along a curve, False if about a point.
        has_ends: True for lines that end by themselves; False where they go on as far as anyone looked.
        sided: True where one side stands higher than the other; a record does not say which.
        made_of: kind of crossings that the grammar makes it of; "" if the grammar does not choose it.
        words: adjective for each size that is worth a word ("height": "deep").
        colour: red, green, blue and opacity in pictures, 0 to 1.
        typical: height and width that its intervals are calibrated at, m; None: they are not.
    """

    name: str
    plural: str
    sign: int
    line: bool
    has_ends: bool = False
    sided: bool = False
    made_of: str = ""
    words: Mapping[str, str] = field(default_factory=dict)
    colour: Colour = (0.25, 0.25, 0.25, 1.0)
    typical: tuple[float, float] | None = None

    @property
    def sampled(self) -> bool:
        """True if it has a posterior."""
        return False

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """Preliminary sizes from a feature's intervals, kept to what a ball of the tip's radius can feel."""
        height, sd, width = preliminary(feature, tip_radius)
        radius = max(radius_of_cap(height, width), 0.5 * height)
        half = float(contact_half_width(height, radius, tip_radius))
        return Sizes(height, sd, radius, half, place_sd(feature, half))

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights that the feature's median shape leaves on the trace, m; 0 if no closed form knows them.

        Args:
            feature: of this kind.
            feet: (N, 3) points of the base, m.
            normals: (N, 3) outward unit normals there.
            tip_radius: radius of the fingertip, m.
        """
        return np.zeros(len(feet))

    def problem(self, feature: Feature, around: Surroundings) -> PosteriorProblem:
        """The posed posterior.

        Raises:
            MappingError: the kind has no closed form.
        """
        possible = ", ".join(name for name in KINDS if kind_named(name).sampled)
        raise MappingError(f"no posterior for a {self.name!r}: closed-form traces exist for {possible}")

    def alternatives(self, problem: PosteriorProblem, around: Surroundings) -> Sequence[PosteriorProblem]:
        """Further families on the same window, tried where the first does not fit within the noise.

        Args:
            problem: of the first family, as posed for the nominal tip.
            around: what it was posed in.
        """
        return ()

    def rivals(self, problem: PosteriorProblem, optimum: FloatArray) -> Sequence[PosteriorProblem]:
        """Further families that may leave the same trace, weighed against the first by their evidence.

        Args:
            problem: as posed for the nominal tip.
            optimum: (P,) of it, where the search for theirs begins.
        """
        return ()

    def has_plain_member(self, shape: Shape) -> bool:
        """True of a family with a plainest member, which counts on its own."""
        return False

    def plain_odds(self, shape: Shape, draws: FloatArray) -> float:
        """Bayes factor of the plainest member of a family, which people make and lay there, against all of it; 0: none.

        Args:
            shape: the family.
            draws: (S, P) of its posterior.
        """
        return 0.0

    def claims_more(self, shape: Shape) -> bool:
        """True of a family that claims what a plainer rival does not: it is told only where that one is unlikely."""
        return False

    def draws_of_height(self, shape: Shape, draws: FloatArray) -> FloatArray:
        """(S,) heights that draws (S, P) of one of the competing families say, m.

        Raises:
            MappingError: the kind has none that compete.
        """
        raise MappingError(f"no families compete for a {self.name!r}")

    def widths_felt(self, shape: Shape, draws: FloatArray, *, half_way: bool = False) -> tuple[FloatArray, FloatArray]:
        """(S,) widths that were touched if draws (S, P) are true, and within which the foot lies, m.

        Args:
            shape: one of the competing families; what runs out has no foot, and its width is that at half height.
            draws: of it.
            half_way: True to ask where half of the height lies instead, in every family.

        Raises:
            MappingError: the kind has no families that compete.
        """
        raise MappingError(f"no families compete for a {self.name!r}")

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """What draws (S, P) of the shape's parameters say of the feature's cross-section.

        Raises:
            MappingError: the kind has no closed form.
        """
        raise MappingError(f"a {self.name!r} has no closed form that draws could be of")

    def heights(self, shape: Shape, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        """(N,) heights at single points that parameters (P,) leave, m: what calibration simulates its traces with.

        Args:
            shape: of the posed problem.
            truth: its parameters.
            feet: (N, 3) points of the base, m.
            normals: (N, 3) outward unit normals there.

        Raises:
            MappingError: the kind has no closed form.
        """
        raise MappingError(f"a {self.name!r} has no closed form to simulate")

    def profile(self, feature: Feature, x: FloatArray, feet: FloatArray, normals: FloatArray, tip_radius: float
                ) -> FloatArray:  # fmt: skip
        """(N,) heights for a picture of a sweep that crosses the feature at places x (N,), m; others as in `trace`."""
        return self.trace(feature, feet, normals, tip_radius)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The feature's median shape as a body that can be touched; None where no closed form, or no side, is known.

        Args:
            feature: of this kind.
            exaggeration: factor of its section, height and width; the axis stays.
        """
        return None

    def outline(self, height: float, width: float) -> tuple[FloatArray, bool]:
        """The section (M, 2) that a mesh is drawn with, m (across, outward), and whether it closes to a tube."""
        if height < 0.0:
            return width * np.array([[0.5, RIBBON_LIFT], [-0.5, RIBBON_LIFT]]), False
        turn = np.linspace(0.0, np.pi, SECTION_CORNERS)
        return np.column_stack([0.5 * width * np.cos(turn), height * np.sin(turn)]), True


def kind_named(name: str) -> Kind:
    """The kind of that name.

    Raises:
        MappingError: no kind is called so.
    """
    if name not in KINDS:
        raise MappingError(f"unknown kind {name!r}; possible: {', '.join(KINDS)}")
    return _loaded(KINDS[name])


@cache
def _loaded(place: str) -> Kind:
    module, name = place.split(":")
    found: Kind = getattr(import_module(module), name)
    return found


def kind_of(feature: Feature) -> Kind:
    """The kind of a feature."""
    return kind_named(feature.kind)


def kind_made_of(crossings: str, *, line: bool) -> Kind:
    """The kind that the grammar makes of crossings of a kind, along a line or about a point.

    Raises:
        MappingError: it makes nothing of such crossings.
    """
    for kind in map(kind_named, KINDS):
        if kind.made_of == crossings and (kind.line is line or kind.sided):
            return kind
    raise MappingError(f"nothing is made of {crossings!r} crossings")


def sizes_of(feature: Feature, tip_radius: float) -> Sizes:
    """A feature's preliminary sizes, by its kind."""
    return kind_of(feature).sizes(feature, tip_radius)


def feature_trace(feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights that a feature's median shape leaves on the trace, m, by its kind; see `Kind.trace`."""
    return kind_of(feature).trace(feature, feet, normals, tip_radius)


def rise_of(features: Sequence[Feature]) -> float:
    """Height of the highest step among features, m; 0 if none is one."""
    return max((abs(feature.height.median) for feature in features if kind_of(feature).sided), default=0.0)


def uphill(step: Feature, points: FloatArray) -> FloatArray:
    """(N,) distances of points (N, 3) from the edge of a step, to its high side, m; 0 where that is not known.

    The edge goes on straight beyond its ends, as far as anyone asks.
    """
    axis, side = step.axis, step.details.high_side
    if side is None or len(axis) < 2:
        return np.zeros(len(points))
    leg = np.searchsorted(arclengths(axis), nearest_on(points, axis)[1]) - 1
    leg = np.clip(leg, 0, len(axis) - 2)
    lateral = np.cross(step.normals[leg], axis[leg + 1] - axis[leg])
    length = np.maximum(np.linalg.norm(lateral, axis=1), np.finfo(float).tiny)
    return np.asarray(side * ((points - axis[leg]) * lateral).sum(axis=1) / length)


def preliminary(feature: Feature, tip_radius: float) -> tuple[float, float, float]:
    """Height, its standard deviation and width from a feature's intervals, m, none of them zero."""
    farther = max(abs(feature.height.low), abs(feature.height.high))
    height = max(abs(feature.height.median), LEAST_OF_MOST * farther, 1e-9 * tip_radius)
    sd = max(abs(feature.height.high - feature.height.low) / 3.29, 1e-3 * height)
    return height, sd, feature.width.median if feature.width.median > 0.0 else height


def place_sd(feature: Feature, half_width: float) -> float:
    """Standard deviation of a feature's place, m; a tenth of the half-width where it is not known."""
    sd = feature.position_sd
    return float(sd) if np.isfinite(sd) and sd > 0.0 else 0.1 * half_width
