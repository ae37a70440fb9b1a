"""Survey: sweeps over the whole global model, close enough that no feature asked for is missed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hw import Move
from mapping import FloatArray, IntArray, Surface, length_text
from mapping.base import Base
from mapping.detection import Coverage, coverage
from mapping.geometry.mesh import asked_part
from planners import Outcome, Plan, PlannerError, executed
from planners.paths import Carrier, Isoline, isolines, pressed_sweep, sound_parts, thinned, touched_points
from planners.survey.charts import crease_charts
from planners.survey.level_field import LevelField, level_field
from planners.survey.slices import Slices, slice_axes, slices_for


@dataclass(frozen=True, eq=False, kw_only=True)
class Survey:
    """Parallel sweeps that meet every bump of a height, or crossed ones that meet every ridge of a span.

    A feature of height D disturbs the trace within sqrt(2 r D) of its crest (theory section 4); a sweep
    that passes it at the distance x still sees the height D - x^2 / (2 r). Bumps need strips: sweeps along the
    level sets of an evenly spaced field, so close that everywhere at least `visible` of the height D stays. Where
    only ridges of a span must not be missed, crossed families of plane sections do with far less path
    (planners.survey.slices).

    Args:
        base: the global model.
        tip_radius: r, m.
        smallest: height D of the smallest feature to be found, m.
        speed, force: of the sweeps, m/s and N.
        shortest_ridge: distance between the ends of the shortest ridge to be found, m; None: bumps as well.
        region: (low, high) corners in m of the box whose part of the surface is inspected; everything if None.
        sides: (S, 3) outward directions: what faces none of them is not inspected; None: all is.
        visible: share of the smallest feature's height that every sweep pair must leave visible.
        crossings: how often a straight ridge of the shortest span must be crossed.
    """

    base: Base
    tip_radius: float
    smallest: float
    speed: float = 0.03
    force: float = 1.0
    shortest_ridge: float | None = None
    region: tuple[FloatArray, FloatArray] | None = None
    sides: FloatArray | None = None
    visible: float = 0.35
    crossings: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.smallest < np.inf:
            raise PlannerError(f"the smallest feature must have a positive height in metres; found {self.smallest}")
        if self.shortest_ridge is not None and not 0 < self.shortest_ridge < np.inf:
            raise PlannerError(f"the shortest ridge must have a positive span in metres; found {self.shortest_ridge}")
        if not 0 < self.visible < 1:
            raise PlannerError(f"the visible share must lie between 0 and 1; found {self.visible}")

    @property
    def pitch(self) -> float:
        """Width of the strip in which a sweep sees the smallest feature, m; never more than a tip radius."""
        return self.strip(self.visible)

    def strip(self, visible: float) -> float:
        """Width of the strip in which a sweep sees a share of the smallest feature, m."""
        return float(min(2.0 * np.sqrt(2.0 * self.smallest * (1.0 - visible) * self.tip_radius), self.tip_radius))

    @cached_property
    def surface(self) -> Surface | None:
        """What is to be inspected: the base's surface, or its part in the region and on the sides; None if none."""
        return asked_part(self.base.surface, self.region, self.sides)

    @property
    def foretold_path(self) -> float:
        """Length of all sweeps before any is laid out, m: the area over the width that each line of it answers for.

        Of a body that can be reached everywhere that is what the sweeps come to, but for their ends.
        """
        if self.surface is None:
            return 0.0
        slices = self.crossed(self.visible)
        lines_per_metre = 1.0 / self.pitch if slices is None else len(slices.axes) / slices.pitch
        return float(self.surface.face_areas.sum() * lines_per_metre)

    def plan(self) -> Plan:
        """Yield every sweep; the outcome's value is the planned Coverage."""
        touched: list[FloatArray] = []
        for move in self.sweeps():
            answer = yield move
            touched.extend(self.touched(part) for part in executed(move, answer))
        done = self.covered(touched)
        detail = f"{100 * done.fraction:.1f} % of the surface lies within {length_text(done.reach)} of a sweep"
        return Outcome("done" if done.fraction > 0.99 else "not all reached", detail, done)

    def touched(self, move: Move) -> FloatArray:
        """(K, 3) places of the base that a sweep touches at its waypoints, m."""
        return self.base.foot(move.path, self.tip_radius).points

    def covered(self, paths: list[FloatArray], pitch: float | None = None, faces: IntArray | None = None) -> Coverage:
        """Coverage of the region, or of some of its faces, by touched paths (each (K, 3), m) that see strips as wide as
        the pitch."""
        pitch = pitch or self.pitch
        dense = [_dense(path, 0.2 * pitch) for path in paths]
        points = np.concatenate(dense) if dense else np.zeros((0, 3))
        if self.surface is None:
            return Coverage(np.zeros(0), 0.0, 0.55 * pitch)
        part = self.surface if faces is None else Surface(self.surface.vertices, self.surface.faces[faces])
        return coverage(part, points, 0.55 * pitch)

    def crossed(self, visible: float) -> Slices | None:
        """The crossed plane sections that see a visible share, or None where strips are asked for or are shorter."""
        if self.shortest_ridge is None or not self._charts:
            return None
        if self.crossings > 1:
            return Slices(self._axes, self.shortest_ridge / self.crossings)
        strip = self.strip(visible)
        slices = slices_for(self._axes, self.shortest_ridge, 0.5 * strip)
        return slices if len(slices.axes) * strip < slices.pitch else None

    @cached_property
    def _axes(self) -> FloatArray:
        assert self.surface is not None  # it has charts
        return slice_axes(self.surface, np.concatenate(self._charts))

    @cached_property
    def _charts(self) -> list[IntArray]:
        return [] if self.surface is None else crease_charts(self.surface)

    def sweeps(self, visible: float | None = None) -> Iterator[Move]:
        """All sweeps, each begun near the end of the one before it; another visible share may be given."""
        for line in self.lines(visible):
            yield from self.pressed(line)

    def lines(self, visible: float | None = None) -> Iterator[Isoline]:
        """Where the sweeps touch the base; what ball and stem can make of each is worked out by `pressed`."""
        if self.surface is None:
            return iter(())
        visible = visible or self.visible
        slices = self.crossed(visible)
        if slices is None:
            return self._strips(self.surface, self.strip(visible))
        return self._sections(self.surface, slices)

    def _sections(self, surface: Surface, slices: Slices) -> Iterator[Isoline]:
        """Lines along one family of plane sections after the other."""
        used = surface.vertices[np.unique(surface.faces[np.concatenate(self._charts)])]
        here: FloatArray | None = None
        for axis in slices.axes:
            values = surface.vertices @ axis
            for level in slices.levels(axis, used):
                lines = [
                    line
                    for chart in self._charts
                    for line in isolines(surface.vertices, surface.faces, chart, values, float(level))
                ]
                for line in _in_turn(lines, here, self.pitch):
                    here = line.points[-1]
                    yield line

    @cached_property
    def _fields(self) -> dict[int, LevelField]:
        """The fields solved so far, by the number of the chart."""
        return {}

    def _strips(self, surface: Surface, pitch: float) -> Iterator[Isoline]:
        """Lines along the level sets of one chart after the other, a pitch apart."""
        here: FloatArray | None = None
        done = np.zeros(len(surface.faces), dtype=bool)
        for number, chart in enumerate(self._charts):
            if done[chart].all():
                continue
            touched = []
            if number not in self._fields:
                self._fields[number] = level_field(surface, surface.vertices, chart, self.tip_radius)
            levels = self._fields[number]
            for level in levels.levels(pitch):
                lines = isolines(surface.vertices, surface.faces, chart, levels.values, float(level))
                for line in _in_turn(lines, here, pitch):
                    here = line.points[-1]
                    touched.append(line.points)
                    yield line
            later = np.concatenate([np.zeros(0, dtype=np.int64), *self._charts[number + 1 :]])
            later = later[~done[later]]
            if len(later):
                done[later] = self.covered(touched, pitch, later).share > 0.999

    def pressed(self, line: Isoline) -> Iterator[Move]:
        """The sweeps along a line that ball and stem can make."""
        assert self.surface is not None  # the line lies on it
        points, normals = touched_points(line, self.surface)
        points, normals = thinned(points, normals, min(0.1 * self.tip_radius, 0.5 * self.pitch))
        sweep = pressed_sweep(points, normals, self.tip_radius, self.speed, self.force)
        # one by one: what is sent to a plan of sweeps must not reach a list
        for part in sound_parts(sweep, self._carrier):  # noqa: UP028
            yield part

    @cached_property
    def _carrier(self) -> Carrier:
        return Carrier.of(self.base, self.tip_radius)


def _in_turn(lines: list[Isoline], here: FloatArray | None, pitch: float) -> Iterator[Isoline]:
    """The lines, each begun near the end of the one before, without those shorter than a tenth of the pitch."""
    while lines:
        nearest = 0 if here is None else int(np.argmin([_gap(line, here) for line in lines]))
        line = _begun_near(lines.pop(nearest), here, pitch)
        if line.length >= 0.1 * pitch:
            here = line.points[-1]
            yield line


def _gap(line: Isoline, here: FloatArray) -> float:
    candidates = line.points if line.closed else line.points[[0, -1]]
    return float(np.linalg.norm(candidates - here, axis=1).min())


def _begun_near(line: Isoline, here: FloatArray | None, overlap: float) -> Isoline:
    """The line begun at the end (or, if closed, the point) nearest to `here`; a closed one overlaps itself."""
    points, faces = line.points, line.faces
    if line.closed:
        start = 0 if here is None else int(np.linalg.norm(points[:-1] - here, axis=1).argmin())
        points, faces = np.roll(points[:-1], -start, axis=0), np.roll(faces, -start)
        along = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
        more = 2 + int(np.searchsorted(along, overlap))
        again = np.arange(len(points) + more) % len(points)
        return Isoline(points[again], faces[again[:-1]])
    if here is not None and np.linalg.norm(points[-1] - here) < np.linalg.norm(points[0] - here):
        return Isoline(points[::-1], faces[::-1])
    return line


def _dense(path: FloatArray, spacing: float) -> FloatArray:
    """The polyline (K, 3) resampled at most `spacing` apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    s = np.linspace(0.0, along[-1], 1 + int(np.ceil(along[-1] / spacing)))
    return np.column_stack([np.interp(s, along, path[:, k]) for k in range(3)])
