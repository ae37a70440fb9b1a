"""Base: the global model that fine features are found on, and the height of a trace above it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray, IntArray, Surface
from mapping.geometry.mesh import CREASE_ANGLE, MovedNearestPoint, NearestPoint
from mapping.instrument import neighbour_scatter, robust_sd

# The mesh of a fitted base goes on so many tip radii beyond the samples: a foot lies at most one aside of its centre,
# on however steep a flank, and with the other no ball that touches there reaches over the border
FIT_MARGIN = 2.0
# Fitted families that are smooth all over: their facets stand for something rounder. Planes, polyhedra and extrusions
# are as flat as they are drawn, or have edges; what is round of an extrusion is drawn to 3e-6 of its radius
SMOOTH_FAMILIES = ("sphere", "cylinder", "quadric", "sheet", "tube", "star body")
# Places of a surface closer together than this hang together, in tip radii. They lie 0.06 apart, and are rounded to
# cells of half of this: links of up to 0.4 + 0.2 sqrt(3), less than half of the strip of 1.8 about the sweep that parts
# a gap from the border
HANGING = 0.4


@dataclass(frozen=True, eq=False)
class Feet:
    """Where ball centres stand over the base.

    Args:
        points: (N, 3) foot points on the base, m.
        normals: (N, 3) unit directions from the foot to the centre (the outward normal there).
        height: (N,) height of the trace over the base's own trace, m: zero on the bare base, positive
            over a bump, negative over a groove.
        face: (N,) base face under the centre.
        barycentric: (N, 3) coordinates of the foot in that face.
    """

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    face: IntArray
    barycentric: FloatArray

    def select(self, index: BoolArray) -> Feet:
        """Those of them alone."""
        return Feet(*(getattr(self, each.name)[index] for each in fields(self)))


# A number, a flag, or rows of numbers
FitValue = bool | float | list[float] | list[list[float]] | list[dict[str, Any]]


class PoseRecord(TypedDict):
    """A pose as JSON values, SI units: see `mapping.base.Pose`."""

    rotation: list[list[float]]
    translation: list[float]
    center: list[float]
    covariance: list[list[float]]
    observable: int
    scatter: float


@dataclass(frozen=True, eq=False)
class Base:
    """The body's known or fitted shape without its fine features.

    Args:
        surface: its mesh.
        kind: "mesh" if it was given, else the fitted family: "profile", "plane", "sphere", "cylinder",
            "quadric", "sheet", "extrusion", "polyhedron", "tube", "star body".
        parameters: what the fit found, by the family's own names (SI), empty for a given mesh.
        missed: by how much a fitted base missed sweeps that it was not fitted to, m; None of one that was not tested.
        pose: the motion from the given mesh to where the object stands; None of one that stands as given.
        offset: by which all heights were found too large, as of a larger ball or a coat; it is taken off them, m.
    """

    surface: Surface
    kind: str = "mesh"
    parameters: dict[str, FitValue] = field(default_factory=dict)
    missed: float | None = None
    pose: PoseRecord | None = None
    offset: float = 0.0

    @property
    def known(self) -> bool:
        """True of a given mesh and of a base that predicted further sweeps: what it does not explain is a feature."""
        return self.kind == "mesh" or self.missed is not None

    @property
    def level_was_felt(self) -> bool:
        """True of a base that lies as high as it was felt, by whatever tip: fitted, or an offset was taken off."""
        return self.kind != "mesh" or self.offset != 0.0

    def beyond(self, bare: FloatArray, tip_radius: float) -> BoolArray:
        """(N,) True of places that a fit has added beyond what was felt: nobody knows of a body there.

        They hang together with the border. A given model has none: its border is the body's.

        Args:
            bare: (N, 3) places all over what no sweep came near, m.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

        face, corner = np.nonzero(self.surface.open_sides)
        if self.kind == "mesh" or not len(face) or not len(bare):
            return np.zeros(len(bare), dtype=bool)
        ends = self.surface.vertices[self.surface.faces]
        start, stop = ends[face, corner - 2], ends[face, corner - 1]
        # a fit's triangles are alike, and so are the distances of places on them: some tell all
        some = bare[:: 1 + len(bare) // 1000]
        spacing = float(np.median(np.asarray(cKDTree(bare).query(some, k=[2])[0]))) if len(bare) > 1 else 0.0
        apart = max(HANGING * tip_radius, 3.0 * spacing)
        cells, number = np.unique(np.round(bare / (0.5 * apart)), axis=0, return_inverse=True)
        cells *= 0.5 * apart
        pairs = cKDTree(cells).query_pairs(apart, output_type="ndarray")
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
        part = connected_components(graph, directed=False)[1]
        longest = float(np.linalg.norm(stop - start, axis=1).max())
        along = np.linspace(0.0, 1.0, 1 + int(np.ceil(2.0 * longest / apart)))[:, None, None]
        border = (start + along * (stop - start)).reshape(-1, 3)
        at_border = np.isfinite(cKDTree(border).query(cells, distance_upper_bound=apart)[0])
        return np.asarray(np.isin(part, part[at_border])[number.ravel()])

    @property
    def levels(self) -> FloatArray:
        """(L,) heights of the parallels that the body stands on as well, m, the first of them 0: itself."""
        told = self.parameters.get("levels")
        above = told[1:] if isinstance(told, list) else []
        return np.array([0.0, *(value for value in above if isinstance(value, float))])

    @property
    def climbs(self) -> list[tuple[FloatArray, float]]:
        """Middle (3,) on the line of centres, and run, m, of each slanted edge between two levels of a profile."""
        told = self.parameters.get("climbs")
        rows = [each for each in told if isinstance(each, dict)] if isinstance(told, list) else []
        return [(np.array(each["place"], dtype=np.float64), float(each["width"])) for each in rows]

    def record(self) -> dict[str, Any]:
        """JSON values of all but the surface and the kind: the "parameters" of model.json and of a log's base."""
        missed = {} if self.missed is None else {"missed": self.missed}
        offset = {"offset": self.offset} if self.offset else {}
        return {**self.parameters, **missed, **offset, **({} if self.pose is None else {"pose": dict(self.pose)})}

    @classmethod
    def read(cls, surface: Surface, kind: str, record: Mapping[str, Any]) -> Base:
        """The base of a surface and of what `record` gave.

        Raises:
            KeyError: a pose without one of its fields.
            TypeError: "missed", "offset" or the pose of another type.
        """
        rest, pose = {name: record[name] for name in record if name not in ("missed", "pose", "offset")}, None
        missed = None if record.get("missed") is None else float(record["missed"])
        if record.get("pose") is not None:
            whole = record["pose"]
            pose = PoseRecord(
                rotation=whole["rotation"],
                translation=whole["translation"],
                center=whole["center"],
                covariance=whole["covariance"],
                observable=int(whole["observable"]),
                scatter=float(whole["scatter"]),
            )
        return cls(surface, kind, rest, missed, pose, float(record.get("offset", 0.0)))

    @cached_property
    def nearest(self) -> NearestPoint:
        """Nearest points of the surface, with the tree that `foot` searches."""
        return NearestPoint(self.surface)

    @property
    def edge_normals(self) -> FloatArray:
        """(F, 3, 3) mean normal of the faces on either side of the edge opposite to each corner of a face."""
        return self.nearest.edge_normals

    def smooth_normals(self, feet: Feet) -> FloatArray:
        """(N, 3) outward unit normals under feet of the smooth body that the facets stand for.

        Over an edge of the body they are the directions to the centres.
        """
        smooth = self.nearest.smooth_normals(feet.face, feet.barycentric)
        on_facets = np.einsum("ij,ij->i", smooth, feet.normals) > np.cos(0.5 * CREASE_ANGLE)
        return np.where(on_facets[:, None], smooth, feet.normals)

    def moved(self, rotation: FloatArray, translation: FloatArray, pose: PoseRecord) -> Base:
        """The base after a rigid motion, x to rotation @ x + translation; `pose` is the whole one from its mesh."""
        moved = replace(self, surface=self.surface.moved(rotation, translation), pose=pose)
        moved.__dict__["nearest"] = MovedNearestPoint(moved.surface, self.nearest, rotation, translation)
        return moved

    def misses(self, centers: FloatArray, tip_radius: float) -> tuple[float, float]:
        """By how much it misses ball centres (N, 3) that it was not fitted to, and their scatter along the path, m.

        The former is the standard deviation of the bulk of their heights over the nearest level: what stands out on the
        base does not count.
        """
        height = self.foot(centers, tip_radius).height
        return robust_sd(np.abs(height[:, None] - self.levels).min(axis=1)), neighbour_scatter(height)

    def foot(self, centers: ArrayLike, tip_radius: float) -> Feet:
        """Foot points and heights of ball centres (N, 3), m.

        The trace of a body is where its distance equals the tip radius r, also over edges and corners, so
        the height is distance - r and the base's own edges explain themselves. Of a fitted round body it is the
        distance from that, not from its facets: where it lies over them by b, and leans from the direction to the
        centre by a, it is nearer by b + r a^2 / 2.
        """
        query = np.asarray(centers, dtype=np.float64)
        nearest = self.nearest.query(query)
        signed = nearest.side * nearest.distance
        away = nearest.side[:, None] * (query - nearest.points)
        # On the surface itself the direction to the centre has no digits left; the mesh normal has.
        clear = nearest.distance > 1e-6 * tip_radius
        safe = np.where(clear, nearest.distance, 1.0)[:, None]
        normals = np.where(clear[:, None], away / safe, nearest.normals)
        height = signed - tip_radius - self.offset
        if self.kind in SMOOTH_FAMILIES:
            smooth, bulge = self.nearest.smooth_body(nearest.face, nearest.barycentric)
            lean = smooth - normals
            height -= bulge + 0.5 * tip_radius * np.einsum("ij,ij->i", lean, lean)
        return Feet(nearest.points, normals, height, nearest.face, nearest.barycentric)
