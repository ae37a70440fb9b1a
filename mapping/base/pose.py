"""Pose: where the object really stands, from how a few sweeps miss the model that was given of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, IntArray, Trace, TraceError
from mapping.base.base import Base, PoseRecord
from mapping.base.cells import Cells
from mapping.instrument import BISQUARE, MAD_TO_SD

# Cells that the pose is fitted to, and of these the share that leads there: a few rounds with all of them then do
MOST_POSE_CELLS, LEADING = 4000, 8
POSE_L1_ROUNDS, POSE_BISQUARE_ROUNDS = 40, 40
# Moves smaller than these shares of the heights' scatter end the rounds; the first kind only leads to the second
SETTLED_L1_MOVE, SETTLED_MOVE = 0.05, 1e-3
# A direction is observed if the trace tells it to this share of the bound
OBSERVED_SHARE = 0.2
# Cells whose height a motion changes by less than this share of itself say nothing: facets of a mesh do that
LEAST_TILT = 0.03
FEWEST_CELLS = 12
# A cell costs at most so many standard deviations; another start must save so many
CUT, GAIN = 10.0, 20.0


@dataclass(frozen=True, eq=False)
class Pose:
    """The rigid motion from the frame of the given model to the frame in which the finger felt.

    A point x of the model lies at rotation @ x + translation. Motions that the trace cannot tell (a plane slides
    in itself, a sphere turns in place) are left out of it.

    Args:
        rotation: (3, 3).
        translation: (3,), m.
        center: (3,) point of the model about which the covariance counts turns, m.
        covariance: (6, 6) of the small turn (rad, axes of the finger's frame) and of the shift of the centre (m);
            along motions that were not observed it is that of the bound.
        observable: how many of the six motions were observed.
        scatter: standard deviation of the cells' heights about the moved model, m.
    """

    rotation: FloatArray
    translation: FloatArray
    center: FloatArray
    covariance: FloatArray
    observable: int = 6
    scatter: float = 0.0

    @property
    def turn(self) -> float:
        """Angle of the rotation, rad."""
        return self.angle(self.rotation)

    @staticmethod
    def angle(rotation: FloatArray) -> float:
        """Angle of a rotation (3, 3), rad."""
        return float(np.linalg.norm(_vector(rotation)))

    @staticmethod
    def turned(vector: FloatArray) -> FloatArray:
        """(3, 3) rotation by a vector (3,), rad."""
        return _rotation(vector)

    @property
    def shift(self) -> FloatArray:
        """(3,) shift of the centre, m."""
        return np.asarray(self.onto(self.center[None])[0] - self.center)

    def onto(self, points: ArrayLike) -> FloatArray:
        """Points (N, 3) of the model where they really are, m."""
        return np.asarray(np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation)

    def back(self, points: ArrayLike) -> FloatArray:
        """Points (N, 3) of the finger's frame in the frame of the model, m."""
        return np.asarray((np.asarray(points, dtype=np.float64) - self.translation) @ self.rotation)

    def after(self, earlier: Pose) -> Pose:
        """The motion that does the earlier one first: this one was found on a model that was already moved."""
        rotation = self.rotation @ earlier.rotation
        translation = self.rotation @ earlier.translation + self.translation
        center = earlier.back(self.center[None])[0]
        return Pose(rotation, translation, center, self.covariance, self.observable, self.scatter)

    def within(self, shift: float, turn: float) -> bool:
        """True if neither the shift (m) nor the turn (rad) exceeds its bound."""
        return bool(np.linalg.norm(self.shift) <= shift and self.turn <= turn)

    def moved(self, base: Base) -> Base:
        """The base where it really stands; it keeps the whole motion from the given mesh."""
        before = Pose.of(base)
        whole = self if before is None else self.after(before)
        return base.moved(self.rotation, self.translation, whole.record())

    def record(self) -> PoseRecord:
        """JSON values that `read` understands, SI units."""
        return PoseRecord(
            rotation=self.rotation.tolist(),
            translation=self.translation.tolist(),
            center=self.center.tolist(),
            covariance=self.covariance.tolist(),
            observable=self.observable,
            scatter=self.scatter,
        )

    @classmethod
    def of(cls, base: Base) -> Pose | None:
        """The whole motion of a base that was moved, None of one that stands as given."""
        return None if base.pose is None else cls.read(base.pose)

    @classmethod
    def read(cls, record: PoseRecord) -> Pose:
        """The pose of a record."""
        arrays = record["rotation"], record["translation"], record["center"], record["covariance"]
        rotation, translation, center, covariance = (np.array(array, dtype=np.float64) for array in arrays)
        return cls(rotation, translation, center, covariance, int(record["observable"]), float(record["scatter"]))


def estimate_pose(trace: Trace, base: Base, *, shift: float = 3e-3, turn: float = float(np.radians(2.0))) -> Pose:
    """How the object stands off its model.

    The heights of the ball's centres over the model's offset surface are brought to zero by Gauss-Newton steps on
    the six motions (point-to-plane ICP on the exact distance field: its gradient is the direction from the foot to
    the centre, also beyond an edge). First the sum of absolute heights is made least, then Tukey's bisquare at the
    scatter of what remains: a fine feature is an outlier and does not pull. Steps go along observed motions only.

    Args:
        trace: some sweeps, best all over the body.
        base: the model as given.
        shift, turn: the largest that are expected, m and rad; a motion told worse than OBSERVED_SHARE of them stays
            as given.

    Raises:
        TraceError: too few samples.

    Reference: Chen and Medioni, Object modelling by registration of multiple range images, Image and Vision Computing
    10, 1992 (point to plane); theory sections 1.3 and 10.2.
    """
    cells = Cells.of(trace, MOST_POSE_CELLS)
    if len(cells.centers) < FEWEST_CELLS:
        raise TraceError(f"a pose needs at least {FEWEST_CELLS} samples; found {len(trace)}")
    search = _Search.of(cells, base, trace.tip_radius, shift, turn)
    best = search.settled(_Motion(np.eye(3), np.zeros(3)))
    start = search.better_start(best)
    if start is not None:
        other = search.settled(start)
        if other.view.cost < best.view.cost - GAIN:
            best = search.without_unobserved(other)
    covariance, count = best.view.covariance(search.bound, search.tilt, cells.sweep)
    units = np.array([1.0 / search.length] * 3 + [1.0] * 3)
    rotation = best.motion.rotation.T
    return Pose(
        rotation,
        -rotation @ best.motion.translation,
        search.middle,
        covariance * np.outer(units, units),
        count,
        best.view.scatter,
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """Rigid motion of the centres back into the frame of the model: x to rotation @ x + translation."""

    rotation: FloatArray
    translation: FloatArray

    def then(self, move: FloatArray, middle: FloatArray, length: float) -> _Motion:
        """Followed by the reverse of a small motion (6,) of the object: a turn times `length`, and a shift, m."""
        turned = _rotation(-move[:3] / length)
        translation = turned @ (self.translation - middle) + middle - move[3:]
        return _Motion(turned @ self.rotation, translation)


@dataclass(frozen=True, eq=False)
class _Settled:
    """Where a descent ended: the motion and what the cells look like from there."""

    motion: _Motion
    view: _View


@dataclass(frozen=True, eq=False)
class _Search:
    """The cells and the model that they are laid on; turns count as lengths at the distance `length` of `middle`."""

    centers: FloatArray
    base: Base
    tip_radius: float
    middle: FloatArray
    length: float
    bound: FloatArray
    tilt: float

    @classmethod
    def of(cls, cells: Cells, base: Base, tip_radius: float, shift: float, turn: float) -> _Search:
        middle = cells.centers.mean(axis=0)
        length = float(np.sqrt(((cells.centers - middle) ** 2).sum(axis=1).mean()))
        bound = np.array([turn * length] * 3 + [shift] * 3)
        return cls(cells.centers, base, tip_radius, middle, length, bound, max(LEAST_TILT, _facet_tilt(base)))

    def view(self, motion: _Motion, robust: bool) -> _View:
        points = self.centers @ motion.rotation.T + motion.translation
        return _View.of(points, self.middle, self.length, self.base, self.tip_radius, robust)

    def settled(self, motion: _Motion) -> _Settled:
        """Gauss-Newton steps along observed motions: least absolute heights first, then the bisquare."""
        few = replace(self, centers=self.centers[::LEADING]) if len(self.centers) > MOST_POSE_CELLS / LEADING else self
        motion = few.descended(motion, False, POSE_L1_ROUNDS, SETTLED_L1_MOVE)
        if few is not self:
            motion = few.descended(motion, True, POSE_BISQUARE_ROUNDS, SETTLED_L1_MOVE)
        motion = self.descended(motion, True, POSE_BISQUARE_ROUNDS, SETTLED_MOVE)
        return _Settled(motion, self.view(motion, robust=True))

    def descended(self, motion: _Motion, robust: bool, rounds: int, near: float) -> _Motion:
        """The motion after at most so many steps, until one moves less than a share of the scatter."""
        for _ in range(rounds):
            view = self.view(motion, robust)
            observed, _ = view.motions(self.bound, self.tilt)
            slopes, heights = view.root[:, None] * (view.slopes @ observed), view.root * view.heights
            move = observed @ np.linalg.lstsq(slopes, heights, rcond=None)[0]
            motion = motion.then(move, self.middle, self.length)
            if np.abs(move).max(initial=0.0) < near * view.scatter:
                break
        return motion

    def better_start(self, settled: _Settled) -> _Motion | None:
        """A place from which another descent promises more, or None.

        Where the object ends before its model does the heights have no slope: the ball drops off an edge that the
        model has further out. Only a step along the motions that seem free brings the model's edge to the ball.
        """
        _, free = settled.view.motions(self.bound, self.tilt)
        if not 0 < free.shape[1] <= 3:
            return None
        reach = np.sqrt((free**2 * self.bound[:, None] ** 2).sum(axis=0))
        grids = np.meshgrid(*[np.linspace(-1.0, 1.0, 7 if free.shape[1] < 3 else 5)] * free.shape[1], indexing="ij")
        starts = [settled.motion.then(free @ (reach * q), self.middle, self.length) for q in
                  np.column_stack([g.ravel() for g in grids])]  # fmt: skip
        costs = [self.view(start, robust=True).cost_at(settled.view.scatter) for start in starts]
        best = int(np.argmin(costs))
        return starts[best] if costs[best] < settled.view.cost - GAIN else None

    def without_unobserved(self, settled: _Settled) -> _Settled:
        """The same with what remains unobserved left as it was given."""
        _, free = settled.view.motions(self.bound, self.tilt)
        turned = -_vector(settled.motion.rotation) * self.length
        shifted = self.middle - settled.motion.rotation @ self.middle - settled.motion.translation
        whole = np.concatenate([turned, shifted])
        motion = settled.motion.then(-free @ (free.T @ whole), self.middle, self.length)
        return _Settled(motion, self.view(motion, robust=True))


@dataclass(frozen=True, eq=False)
class _View:
    """Heights (C,) of the cells, their slopes (C, 6) against turns (times `length`) and shifts, their weights."""

    heights: FloatArray
    slopes: FloatArray
    root: FloatArray
    scatter: float

    @classmethod
    def of(
        cls, points: FloatArray, middle: FloatArray, length: float, base: Base, tip_radius: float, robust: bool
    ) -> _View:
        feet = base.foot(points, tip_radius)
        slopes = np.column_stack([np.cross(points - middle, feet.normals) / length, feet.normals])
        scatter = float(MAD_TO_SD * np.median(np.abs(feet.height)))
        scatter = max(scatter, 1e-12 * (length + float(np.abs(middle).max())))
        u = np.abs(feet.height) / scatter
        weight = np.clip(1.0 - (u / BISQUARE) ** 2, 0.0, None) ** 2 if robust else 1.0 / np.maximum(u, 0.1)
        return cls(feet.height, slopes, np.sqrt(weight), scatter)

    @property
    def cost(self) -> float:
        """Sum of the absolute heights in units of the scatter, each at most CUT."""
        return self.cost_at(self.scatter)

    def cost_at(self, scatter: float) -> float:
        """The same in units of another scatter, m."""
        return float(np.minimum(np.abs(self.heights) / scatter, CUT).sum())

    def motions(self, bound: FloatArray, tilt: float) -> tuple[FloatArray, FloatArray]:
        """Unit motions as columns: those observed (6, K), and the others (6, 6 - K)."""
        weighted = self.root[:, None] * self.slopes
        _, vectors = np.linalg.eigh(weighted.T @ weighted)
        change = np.abs(self.slopes @ vectors)
        strong = (change > tilt) & (self.root > 0)[:, None]
        information = (np.where(strong, change, 0.0) ** 2 * (self.root > 0)[:, None]).sum(axis=0) / self.scatter**2
        allowed = OBSERVED_SHARE * np.sqrt((vectors**2 * bound[:, None] ** 2).sum(axis=0))
        seen = (strong.sum(axis=0) >= FEWEST_CELLS) & (information * allowed**2 > 1.0)
        return vectors[:, seen], vectors[:, ~seen]

    def covariance(self, bound: FloatArray, tilt: float, sweep: IntArray) -> tuple[FloatArray, int]:
        """(6, 6) in the scaled motions, widened for the correlation of neighbouring cells; number observed."""
        observed, others = self.motions(bound, tilt)
        kept = self.root > 0
        slopes = (self.slopes @ observed)[kept]
        inverse = np.linalg.pinv(slopes.T @ slopes)
        both = kept[1:] & kept[:-1] & (sweep[1:] == sweep[:-1])
        product = float((self.heights[1:] * self.heights[:-1])[both].mean()) if both.any() else 0.0
        correlation = np.clip(product / max(float((self.heights[kept] ** 2).mean()), 1e-300), 0.0, 0.95)
        widened = self.scatter**2 * (1.0 + correlation) / (1.0 - correlation)
        unknown = others @ (others.T @ np.diag(bound**2) @ others) @ others.T
        return widened * observed @ inverse @ observed.T + unknown, observed.shape[1]


def _facet_tilt(base: Base) -> float:
    """Sine of the angle by which the facets of a curved part of the mesh stand off the smooth body."""
    mean = (base.surface.face_normals[:, None, :] * base.edge_normals).sum(axis=2).ravel()
    angle = np.arccos(np.clip(mean, -1.0, 1.0))
    smooth = angle[(angle > 1e-6) & (angle < np.radians(15.0))]
    # the corners of a facet stand off twice as much as the middles of its edges
    return float(np.sin(2.0 * np.quantile(smooth, 0.95))) if len(smooth) else 0.0


def _rotation(vector: FloatArray) -> FloatArray:
    """(3, 3) rotation by a vector (3,), rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def _vector(rotation: FloatArray) -> FloatArray:
    """(3,) rotation vector of a rotation by less than a half turn, rad."""
    axial = _axial(rotation)
    sine = 0.5 * float(np.linalg.norm(axial))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(rotation) - 1.0)))
    return np.asarray(axial * (0.5 if sine < 1e-12 else 0.5 * angle / sine))


def _axial(matrix: FloatArray) -> FloatArray:
    return np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
