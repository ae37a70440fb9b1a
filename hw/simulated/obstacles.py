"""Obstacles: what catches the simulated ball and its stem, on their way and while they sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hw import Move, StoppedError
from mapping import BoolArray, FloatArray, lengths, place_text
from mapping.geometry.contact import BallContact, Contacts
from mapping.geometry.mesh import NearestPoint, cores

# How far ball or stem may sink into the body before that is a crash, in tip radii: what a finger yields
YIELDS = 0.05
# Samples along a way, and along the stem's axis behind the ball, in tip radii
WAY_SPACING, STEM_SPACING, STEM_START = 0.25, 0.5, 1.5
# A rise over the commanded path by more than this is looked at again, for the ball may have come down on an overhang,
# or touched in passing what stands beside its way; in tip radii. Sweeps are pressed by 0.02: only details rise so much,
# and what the ball rides over it is also pressed up by from below
HIGH_RISE = 0.1


@dataclass(frozen=True, eq=False)
class Obstacles:
    """The true body, in the way of a ball and the straight stem behind it.

    Args:
        nearest: answers where the body is nearest.
        tip_radius, stem_radius, stem_length: m.
    """

    nearest: NearestPoint
    tip_radius: float
    stem_radius: float
    stem_length: float

    def pass_along(self, move: Move) -> None:
        """Follow a move's path through free space. Raises StoppedError where ball or stem run into the body."""
        self._pass(f"the {move.purpose}", move.path, move.approach)

    def stem_along(self, centers: FloatArray, approach: FloatArray) -> None:
        """The stem behind a ball that sweeps. Raises StoppedError."""
        step = lengths(np.diff(centers, axis=0))
        cell = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / (WAY_SPACING * self.tip_radius))
        kept = np.append(np.flatnonzero(np.diff(cell, prepend=-1.0)), len(cell) - 1)
        self._stem("the sweep", centers[kept], approach[kept])

    def _pass(self, what: str, path: FloatArray, approach: FloatArray) -> None:
        path, approach = _dense(path, approach, WAY_SPACING * self.tip_radius)
        self._refuse(f"{what}: the ball", path, path, self.tip_radius)
        self._stem(what, path, approach)

    def _stem(self, what: str, centers: FloatArray, approach: FloatArray) -> None:
        count = max(
            2, 1 + int(np.ceil(self.stem_length / (STEM_SPACING * self.tip_radius) - STEM_START / STEM_SPACING))
        )
        back = np.linspace(STEM_START * self.tip_radius, self.stem_length, count)
        if self.stem_length <= back[0]:
            return
        stem = (centers[:, None, :] - back[None, :, None] * approach[:, None, :]).reshape(-1, 3)
        self._refuse(f"{what}: the stem", stem, np.repeat(centers, count, axis=0), self.stem_radius)

    def _refuse(self, what: str, points: FloatArray, centers: FloatArray, radius: float) -> None:
        hit = self.nearest.nearer_than(points, radius - YIELDS * self.tip_radius)
        if hit.any():
            center = centers[hit.argmax()]
            where = place_text(center, self.tip_radius)
            raise StoppedError(
                f"{what} runs into the body with the ball at {where}; the finger has drawn back",
                center if points is centers else None,
            )


def pressed_from(
    ball: BallContact, path: FloatArray, approach: FloatArray, stroke: float
) -> tuple[Contacts, FloatArray]:
    """Where balls rest that come from `stroke` outside of the path (N, 3); how far that is outside of it (N,), m.

    A ball that came down on an overhang, or that has no room so far out, is pressed from where it is commanded.
    """
    felt = ball.first_contact(path - stroke * approach, approach, threads=cores())
    over = stroke - felt.distance
    again = np.flatnonzero(felt.overlap | (over > HIGH_RISE * ball.tip_radius))
    if len(again):
        near = ball.press(path[again], approach[again])
        arrays = {name: array.copy() for name, array in vars(felt).items()}
        for name, array in arrays.items():
            array[again] = getattr(near, name)
        felt = replace(felt, **arrays)
        over[again] = -near.distance
    return felt, np.where(felt.count > 0, over, -np.inf)


def stopped_or_landed(
    path: FloatArray,
    touching: BoolArray,
    over: FloatArray,
    tip_radius: float,
    field_angle: float,
    fall: float,
) -> BoolArray:
    """(N,) True where the ball has come down to the body; raises StoppedError where a wall stops it.

    Args:
        path: (N, 3) commanded centres, m.
        touching: (N,) there is contact.
        over: (N,) how far outside of the path the ball rests, m.
        field_angle: rad: the steepest rise that a ball rides over.
        fall: how far the ball comes down between two samples at most, m.
    """
    steps = lengths(np.diff(path, axis=0))
    # where nothing is touched the finger stands where it is commanded to
    height = np.where(touching, over, 0.0)
    rise = np.diff(height)
    # a rise within the field, with a facet's width to spare
    steepest = np.tan(field_angle) * steps + YIELDS * tip_radius
    hit = np.flatnonzero((rise > steepest) & touching[1:])
    if len(hit):
        where = np.round(path[hit[0]], 6).tolist()
        raise StoppedError(
            f"the sweep runs into a wall {1e3 * rise[hit[0]]:.2f} mm high at {where} m; the finger has drawn back",
            path[hit[0]],
        )
    # an edge that is run off: the ball comes down no faster than it can, and no slower than it may ride
    lowest = np.maximum(fall, np.tan(field_angle) * np.append(steps, steps[-1:]))[: len(height)]
    if (-rise <= lowest[:-1] + YIELDS * tip_radius).all():
        return np.ones(len(height), dtype=bool)
    # height_i = max(contact_i, height_(i-1) - lowest): with the drops summed, a running maximum
    summed = np.concatenate([[0.0], np.cumsum(lowest[:-1])])
    ridden = np.maximum.accumulate(height + summed) - summed
    return np.asarray(ridden <= height + YIELDS * tip_radius)


def _dense(path: FloatArray, approach: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """A polyline (K, 3) and its approaches (K, 3) with samples between, at most `spacing` m apart.

    Where the approach turns round by 180 degrees it is taken to flip half-way.
    """
    steps = lengths(np.diff(path, axis=0))
    count = np.maximum(1, np.ceil(steps / spacing).astype(np.int64))
    between_waypoints = [k + np.arange(n) / n for k, n in enumerate(count)]
    place = np.concatenate([*between_waypoints, [float(len(steps))]])
    first = np.minimum(np.floor(place).astype(np.int64), max(len(path) - 2, 0))
    share = (place - first)[..., None]
    last = np.minimum(first + 1, len(path) - 1)
    between = (1.0 - share) * approach[first] + share * approach[last]
    length = np.linalg.norm(between, axis=-1, keepdims=True)
    flipped = np.where(share < 0.5, approach[first], approach[last])
    turned = np.where(length > 1e-6, between / np.maximum(length, 1e-6), flipped)
    centers = (1.0 - share) * path[first] + share * path[last]
    return np.reshape(centers, (-1, 3)), np.reshape(turned, (-1, 3))
