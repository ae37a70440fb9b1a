"""Are labels of estimated points true? Exact rasters over whole bodies, from positions alone and with contacts.

A point is outside its interval if the body is further below it, or stands out further above it, than is proven.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from explore3d.bench.scenes import FILED_BODIES, filed_body
from explore3d.scene import example, load_scene
from mapping import FloatArray, Surface, Trace
from mapping.estimate.envelope import Estimate, estimate_surface
from mapping.estimate.sweeps import TOUCHED
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh import NearestPoint

LABEL_BODIES = ("bunny", "fandisk", "spot", "holed_plate")
LABEL_RATIOS = (0.02, 0.05)  # tip radius over the size of the body
PITCHES_PER_RADIUS = (5, 10)
SAMPLES_PER_PITCH = 5
# Ways of the ball onto the body: one along an axis, two oblique to all
RASTER_DIRECTIONS = ((0.0, 0.0, -1.0), (1.0, 0.3, -0.2), (-0.2, -1.0, 0.4))
STRICT = 1e-6  # of the radius: what recorded contacts are held to
LABEL_ROUNDING = 1e-9  # of the radius: by which balls may overlap a contact, and more than the nearest point's rounding


@dataclass(frozen=True)
class LabelCase:
    """How true the labels of one raster are. Lengths are in tip radii.

    Args:
        body, ratio: the body, and the tip's radius over its size.
        per_radius: sweeps to a tip radius.
        direction: number of the ball's way onto the body.
        method: "positions" alone, or "contacts".
        tolerance: within which points are called touched: the distance between sweeps, or STRICT with contacts.
        samples: of the raster.
        fine: share of the samples on faces that the raster, as it falls on them, could prove to the tolerance if they
            were planes (see `plane_proof`); oblique faces are sampled less finely than the raster is.
        touched: share of the samples' points that are called touched, and of those on such faces.
        strict: share of the samples' points that are proven to be within STRICT.
        worst, worst_strict: largest distance of touched points, and of those within STRICT, from the body.
        beyond: touched points further from the body than the tolerance.
        outside: points outside their intervals.
        below: median of what is proven below the points.
    """

    body: str
    ratio: float
    per_radius: int
    direction: int
    method: str
    tolerance: float
    samples: int
    fine: float
    touched: float
    touched_fine: float
    strict: float
    worst: float
    worst_strict: float
    beyond: int
    outside: int
    below: float


def bench_labels(
    bodies: Sequence[str] = LABEL_BODIES,
    folder: Path | None = None,
    ratios: Sequence[float] = LABEL_RATIOS,
    per_radius: Sequence[int] = PITCHES_PER_RADIUS,
    directions: int = len(RASTER_DIRECTIONS),
) -> Iterator[LabelCase]:
    """Labels of every raster, against the nearest points of the bodies.

    Args:
        bodies: of LABEL_BODIES.
        folder: where the files of published bodies lie.
        directions: how many of the ball's ways onto the body.

    Raises:
        UserError: a body's file is not there.
    """
    for name in bodies:
        mesh = _body(name, folder)
        nearest = NearestPoint(mesh)
        for ratio in ratios:
            radius = ratio * mesh.size
            ball = BallContact(mesh, radius)
            for count in per_radius:
                for k, way in enumerate(RASTER_DIRECTIONS[:directions]):
                    recorded, away = label_raster(mesh, ball, radius / count, np.array(way))
                    bare = Trace(recorded.t, recorded.centers, recorded.sweep, radius)
                    for method, trace, tolerance in (
                        ("positions", bare, 1.0 / count),
                        ("contacts", recorded, STRICT),
                    ):
                        estimate = estimate_surface(
                            trace,
                            "envelope" if method == "positions" else "contact",
                            outward=away,
                            spacing=0.0,
                            tolerance=tolerance * radius,
                        )
                        best = np.zeros(len(trace))  # recorded contacts prove themselves
                        if method == "positions":
                            assert recorded.normals is not None  # a raster has them
                            best = plane_proof(recorded.normals, radius / count, np.array(way), radius) / radius
                        found = _judged(estimate, nearest, best, radius, tolerance)
                        yield LabelCase(name, ratio, count, k, method, tolerance, len(trace), *found)


def _body(name: str, folder: Path | None) -> Surface:
    if name in FILED_BODIES:
        return Surface(*filed_body(name, folder))
    base = load_scene(example(name).scene).base_surface()
    assert base is not None  # shipped bodies give a mesh
    return base


def label_raster(mesh: Surface, ball: BallContact, pitch: float, way: FloatArray) -> tuple[Trace, FloatArray]:
    """An exact raster of sweeps `pitch` (m) apart over a whole body along `way` (3,), and the direction away from it.

    Sweeps turn about at their ends; where the ball passes the body there is no sample.
    """
    way, along, across = _axes(way)
    u, v = mesh.vertices @ along, mesh.vertices @ across
    start = float((mesh.vertices @ way).min()) - 3 * ball.tip_radius
    x = np.arange(u.min(), u.max(), pitch / SAMPLES_PER_PITCH)
    y = np.arange(v.min() + 0.3 * pitch, v.max(), pitch)
    rows = [np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), height)]) for k, height in enumerate(y)]
    place = np.vstack(rows)
    found = ball.first_contact(place @ np.array([along, across]) + start * way, way)
    met = np.flatnonzero(np.isfinite(found.distance))
    number = np.repeat(np.arange(len(y)), len(x))[met]
    return Trace(
        np.arange(len(met), dtype=np.float64), found.centers[met], number, ball.tip_radius, found.normals[met]
    ), -way


def _axes(way: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors along a way, and along and across the sweeps of its raster."""
    way = way / np.linalg.norm(way)
    along = np.cross(way, [0.3, 0.5, 0.8])
    along /= np.linalg.norm(along)
    return way, along, np.cross(way, along)


def plane_proof(normals: FloatArray, pitch: float, way: FloatArray, radius: float) -> FloatArray:
    """(N,) how far below its points a plane of each normal (N, 3) may be, for all that a raster's positions say, m.

    The contacts are a lattice on the plane. A ball's patch is what is nearer to its contact than to others: needles at
    its far corners, one for each ball, give the same positions (theory 4.8). A corner is as far as the circumradius R
    of the lattice's least oblique triangle and lies on the ball, r - sqrt(r^2 - R^2) above the plane (equation 4.17).
    Infinite where balls so far apart leave places between them untouched.
    """
    way, along, across = _axes(way)
    facing = normals @ way
    a, b = (
        step * (axis - (normals @ axis / facing)[:, None] * way)
        for axis, step in ((along, pitch / SAMPLES_PER_PITCH), (across, pitch))
    )
    while True:  # Gauss's reduction of a lattice of two dimensions
        short = ((a * a).sum(axis=1) <= (b * b).sum(axis=1))[:, None]
        a, b = np.where(short, a, b), np.where(short, b, a)
        turns = np.round((a * b).sum(axis=1) / (a * a).sum(axis=1))
        if not turns.any():
            break
        b = b - turns[:, None] * a
    b = np.where(((a * b).sum(axis=1) < 0)[:, None], -b, b)
    sides = np.prod([np.linalg.norm(side, axis=1) for side in (a, b, a - b)], axis=0)
    corner = sides / (2.0 * np.linalg.norm(np.cross(a, b), axis=1))
    sag = radius - np.sqrt(np.maximum(radius**2 - corner**2, 0.0))
    return np.where(corner < radius, np.hypot(corner, sag), np.inf)


def _judged(
    estimate: Estimate, nearest: NearestPoint, best: FloatArray, radius: float, tolerance: float
) -> tuple[float, float, float, float, float, float, int, int, float]:
    """The numbers of a LabelCase from `fine` on; `best` is what each sample's face allows to prove, in radii."""
    found = nearest.query(estimate.points)
    off = found.side * found.distance / radius
    below, above = estimate.below / radius, estimate.above / radius
    own, touched, strict = estimate.sample >= 0, estimate.labels == TOUCHED, below <= STRICT
    fine = own & (best[estimate.sample] <= tolerance)
    return (
        float(fine[own].mean()),
        float(touched[own].mean()),
        float(touched[fine].mean()) if fine.any() else np.nan,
        float(strict[own].mean()),
        float(off[touched].max(initial=0.0)),
        float(off[strict].max(initial=0.0)),
        int((off[touched] > tolerance + LABEL_ROUNDING).sum()),
        int(((off > below + LABEL_ROUNDING) | (off < -above - LABEL_ROUNDING)).sum()),
        float(np.median(below)),
    )


def label_lines(cases: Iterable[LabelCase]) -> Iterator[str]:
    """The cases as CSV, line by line."""
    for number, case in enumerate(cases):
        record = asdict(case)
        if number == 0:
            yield ",".join(record)
        yield ",".join(f"{value:.4g}" if isinstance(value, float) else str(value) for value in record.values())
