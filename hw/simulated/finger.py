"""SimulatedFinger: the embedded default, exact contact on a mesh plus the apparatus' noise."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import cached_property
from types import TracebackType
from typing import Any

import numpy as np

from hw import FingerError, Move, Workspace
from hw.simulated.noise_source import NoiseSource
from hw.simulated.obstacles import Obstacles, pressed_from, stopped_or_landed
from mapping import BoolArray, FloatArray, Surface, Trace, dots, lengths
from mapping.geometry.contact import BallContact, Contacts
from mapping.geometry.mesh import NearestPoint

# The simulated finger's top speed unless it is given, in tip radii per second: no machine's, only a bound for plans
TOP_SPEED_RADII = 25.0


@dataclass(kw_only=True)
class SimulatedFinger:
    """A rigid spherical finger that presses on a rigid body and samples its centre.

    At each sample of a sweep the ball comes from `stroke` outside of the commanded path along the approach
    direction and stops at the first contact; where it meets nothing within `stroke` beyond the path there
    is no contact, and no sample. Contact is continuous: a wall beside the way, over which the ball cannot ride within
    the sensor's field, stops it, and so does anything in the way of ball or stem during a move. That is a
    fault as on a machine: nothing of the move is felt, and the finger draws back the way that it came. A ball that
    runs off an edge is in no contact until it has come down, at the largest speed.

    The way between two moves that nobody commanded is taken for free and only its time counts: a plan that knows the
    body commands its ways (planners.paths.routed). The noise of the k-th sweep depends on `seed` and k alone, so a run
    that is resumed feels what the uninterrupted run would have felt.

    Args:
        object: the true body, m.
        tip_radius: radius of the ball, m.
        rate: samples per second.
        white, correlated, correlation_length, angle, contact: see hw.simulated.noise_source.NoiseSource.
        contact_data: also return contact normals and contact points.
        seed: of all noise.
        max_speed: fastest move that is not refused, m/s; None for 25 tip radii per second.
        max_force: largest force that is not refused, N.
        margin: how far the workspace reaches beyond the body's bounding box, m; None for 6 tip radii.
        stroke: travel of the finger to either side of the commanded path, m; None for 2 tip radii.
        field_angle: contacts further than this from the approach axis are not felt, rad (paper: 75 degrees).
        stem_radius, stem_length: of the straight stem behind the ball that may run into the body, m; None for half
            a tip radius and six.
    """

    object: Surface
    tip_radius: float
    rate: float = 5000.0
    white: float = 0.0
    correlated: float = 0.0
    correlation_length: float = 1e-3
    angle: float = 0.0
    contact: float = 0.0
    contact_data: bool = False
    seed: int = 0
    max_speed: float | None = None
    max_force: float = 10.0
    margin: InitVar[float | None] = None
    stroke: float | None = None
    field_angle: float = float(np.radians(75.0))
    stem_radius: float | None = None
    stem_length: float | None = None
    _ball: BallContact = field(init=False, repr=False)
    _workspace: Workspace = field(init=False, repr=False)
    _noise: NoiseSource = field(init=False, repr=False)
    _clock: float = field(init=False, default=0.0)
    _sweeps: int = field(init=False, default=0)
    _last: Move | None = field(init=False, default=None)

    def __post_init__(self, margin: float | None) -> None:
        self._require_positive("tip_radius", "rate", "correlation_length", "max_force")
        fastest = TOP_SPEED_RADII * self.tip_radius if self.max_speed is None else self.max_speed
        if not 0 < fastest < np.inf:
            raise FingerError(f"simulated finger: max_speed must be positive; found {fastest}")
        for name in ("white", "correlated", "angle", "contact"):
            if not 0 <= getattr(self, name) < np.inf:
                raise FingerError(f"simulated finger: {name} must be zero or positive; found {getattr(self, name)}")
        reach = 6.0 * self.tip_radius if margin is None else margin
        low, high = self.object.bounds
        self._workspace = Workspace(low - reach, high + reach, fastest, self.max_force)
        self._ball = BallContact(self.object, self.tip_radius)
        self._noise = NoiseSource(self.white, self.correlated, self.correlation_length, self.angle, self.contact)

    def _require_positive(self, *names: str) -> None:
        for name in names:
            if not 0 < getattr(self, name) < np.inf:
                raise FingerError(f"simulated finger: {name} must be positive; found {getattr(self, name)}")

    @property
    def workspace(self) -> Workspace:
        """The body's bounding box widened by the margin."""
        return self._workspace

    @property
    def info(self) -> dict[str, Any]:
        """Settings of the simulation."""
        names = ("rate", "white", "correlated", "correlation_length", "angle", "contact", "contact_data", "seed")
        return {"kind": "simulated", "tip_radius": self.tip_radius} | {name: getattr(self, name) for name in names}

    @property
    def clock(self) -> float:
        """Simulated time since the finger was opened, s."""
        return self._clock

    def execute(self, move: Move) -> Trace:
        """Carry out one move; the samples in contact of a sweep, nothing for any other purpose.

        Raises:
            FingerError: the move leaves the workspace, or is faster or harder than allowed.
            StoppedError: ball or stem ran into the body.
        """
        self._refuse_what_exceeds(move)
        if move.purpose != "sweep":
            self._obstacles.pass_along(move)
            self._passed(move)
            return self._empty()
        path, approach, times, spacing = sampled(move, self.rate)
        felt, keep = self._pressed(path, approach)
        start = self._passed(move)
        return self._sweep(path, times, spacing, felt, keep, start)

    def skip(self, move: Move) -> None:
        """Take a move for made: what an earlier session felt is not felt again, but time and noise go on from it."""
        self._passed(move)
        self._sweeps += move.purpose == "sweep"

    def _passed(self, move: Move) -> float:
        """Advance the clock over a move; when it begins, s."""
        gap = 0.0 if self._last is None else float(np.linalg.norm(move.path[0] - self._last.path[-1]))
        # a plan that does not command the way between two sweeps still pays for it
        self._clock += gap / self._workspace.max_speed
        start, self._clock = self._clock, self._clock + move.duration
        self._last = move
        return start

    def _refuse_what_exceeds(self, move: Move) -> None:
        low, high, path = self._workspace.low, self._workspace.high, move.path
        outside = ((path < low) | (path > high)).any(axis=1)
        if outside.any():
            where = np.round(path[outside.argmax()], 6).tolist()
            raise FingerError(
                f"the {move.purpose} leaves the workspace at {where} m; the centre may move from "
                f"{np.round(low, 6).tolist()} to {np.round(high, 6).tolist()} m"
            )
        fastest = self._workspace.max_speed
        if move.speed > fastest:
            raise FingerError(f"the {move.purpose} asks for {move.speed} m/s; at most {fastest} m/s is possible")
        if move.force > self.max_force:
            raise FingerError(f"the {move.purpose} asks for {move.force} N; at most {self.max_force} N are possible")

    def _sweep(
        self, path: FloatArray, times: FloatArray, spacing: float, felt: Contacts, keep: BoolArray, start: float
    ) -> Trace:
        self._sweeps += 1
        rng = np.random.default_rng((self.seed, self._sweeps))
        centers = (felt.centers + self._noise.of_centers(rng, len(path), spacing))[keep]
        normals = contacts = None
        if self.contact_data:
            normals = self._noise.of_normals(rng, felt.normals[keep])
            contacts = felt.points[keep] + self._noise.of_contacts(rng, len(centers))
        sweep = np.full(len(centers), self._sweeps)
        return Trace(start + times[keep], centers, sweep, self.tip_radius, normals, contacts)

    def _pressed(self, path: FloatArray, approach: FloatArray) -> tuple[Contacts, BoolArray]:
        """Where the ball rests at every sample of a sweep, and which samples are felt. Raises StoppedError."""
        stroke = 2.0 * self.tip_radius if self.stroke is None else self.stroke
        felt, over = pressed_from(self._ball, path, approach, stroke)
        against = -dots(felt.normals, approach)
        touching = (felt.count > 0) & (over >= -stroke)
        keep = touching & (against >= np.cos(self.field_angle))
        fall = self._workspace.max_speed / self.rate
        keep &= stopped_or_landed(path, touching, over, self.tip_radius, self.field_angle, fall)
        ridden = path - np.where(touching & (over > 0), over, 0.0)[:, None] * approach
        self._obstacles.stem_along(ridden, approach)
        return felt, np.asarray(keep)

    @cached_property
    def _obstacles(self) -> Obstacles:
        """What ball and stem may run into: the true body."""
        radius = 0.5 * self.tip_radius if self.stem_radius is None else self.stem_radius
        length = 6.0 * self.tip_radius if self.stem_length is None else self.stem_length
        return Obstacles(NearestPoint(self.object), self.tip_radius, radius, length)

    def _empty(self) -> Trace:
        return Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), self.tip_radius)

    def __enter__(self) -> SimulatedFinger:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        return None


def sampled(move: Move, rate: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Commanded centres (N, 3), approach directions (N, 3), times (N,) since the start, and their spacing in m."""
    steps = np.linalg.norm(np.diff(move.path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    spacing = move.speed / rate
    s = np.asarray(np.arange(int(along[-1] / spacing * (1 + 1e-12)) + 1) * spacing, dtype=np.float64)
    path, approach = (_interpolated(s, along, values) for values in (move.path, move.approach))
    length = lengths(approach)[:, None]
    if (length < 1e-6).any():
        raise FingerError(
            "the sweep turns its approach by 180 degrees between two waypoints; add waypoints between them"
        )
    return path, approach / length, s / move.speed, spacing


def _interpolated(s: FloatArray, along: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(s, along, values[:, k]) for k in range(3)])
