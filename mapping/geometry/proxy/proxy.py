"""Proxy: the ball that a person leads over a body, and the force that pulls the hand back to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, ContactError, FloatArray
from mapping.geometry.proxy.body import ProxyBody

# Tip radii beyond the highest part at which a free place is looked for first
CLEARANCE = 1e-3
# Of the radius: so deep the first pressing goes at most; and how often it is repeated
DEEPEST_PRESSING, PRESSING_ROUNDS = 0.3, 3


@dataclass(frozen=True, eq=False)
class Followed:
    """What the ball did while the device moved.

    Args:
        device: (N, 3) places of the device, m.
        centers: (N, 3) centres of the ball, m.
        touching: (N,) whether it touched.
    """

    device: FloatArray
    centers: FloatArray
    touching: BoolArray

    def force(self, stiffness: float) -> FloatArray:
        """(N, 3) forces on the hand, N, of a spring (N/m) from the device to the ball."""
        return np.asarray(stiffness * (self.centers - self.device))


class Proxy:
    """A ball outside of a body that follows the device as near as the body lets it (a god-object).

    Its centre moves to where its distance from the device has a local minimum, and never through the body. Two
    properties follow from that (theory section 12): the spring's energy grows in no step by more than the
    hand gives plus half the stiffness times the step's square, and the force is along the contact normals.

    Args:
        body: what it touches, and its own radius.
        friction: coefficient of the friction cone, at least 0.

    Reference: Zilles and Salisbury, IROS 1995; Ruspini, Kolarov and Khatib, SIGGRAPH 1997; Harwin and Melder 2002.

    Raises:
        ContactError: a negative friction.
    """

    def __init__(self, body: ProxyBody, friction: float = 0.0) -> None:
        if not (np.isfinite(friction) and friction >= 0.0):
            raise ContactError(f"friction must be a coefficient of at least 0; found {friction!r}")
        self.body, self.friction = body, float(friction)
        self._center: FloatArray | None = None

    @property
    def center(self) -> FloatArray | None:
        """(3,) where it is, m; None before it was led anywhere."""
        return self._center

    def follow(self, path: ArrayLike) -> Followed:
        """Lead it along places (N, 3) of the device, m; it begins where it was left, or free over the first place.

        Raises:
            ContactError: places of the wrong shape or not finite, or no free place over the first.
        """
        from mapping.geometry.proxy import proxy_kernels

        places = np.ascontiguousarray(path, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
            raise ContactError(f"the device's places must be finite and of shape (N, 3); found shape {places.shape}")
        if len(places) == 0:
            return Followed(places, places.copy(), np.zeros(0, dtype=bool))
        body = self.body
        start = free_place(body, places[0]) if self._center is None else self._center
        centers, touching = np.empty_like(places), np.zeros(len(places), dtype=bool)
        proxy_kernels.follow_path(
            body.arrays, body.scale * body.radius, self.friction, body.into(start[None])[0], body.into(places),
            centers, touching,
        )  # fmt: skip
        centers = body.out(centers)
        self._center = centers[-1].copy()
        return Followed(places, centers, touching)


def pressed_along(
    body: ProxyBody, path: FloatArray, inwards: FloatArray, press: float, friction: float = 0.0
) -> Followed:
    """The ball where a device stands over each place of a path, pressed a little into the spring and no more.

    First it is pressed deep enough for every floor, but then the ball is beside its place, and dwells at kinks; so
    twice more, each time as deep as the ball was found.

    Args:
        path: (N, 3) places of the device if nothing were there, m, near the base's own trace.
        inwards: (N, 3) unit directions of pressing.
        press: depth of the device below the ball, m.
        friction: coefficient.
    """
    depth = np.full(len(path), min(1.01 * body.bottom, DEEPEST_PRESSING * body.radius) + press)
    for _ in range(PRESSING_ROUNDS):
        felt = Proxy(body, friction).follow(path + depth[:, None] * inwards)
        depth = np.einsum("ij,ij->i", felt.centers - path, inwards) + press
    return felt


def free_place(body: ProxyBody, place: FloatArray) -> FloatArray:
    """(3,) a place where the ball is free, m: the given one, or the nearest that is found straight off the base.

    Raises:
        ContactError: none is found within the size of the body.
    """
    near = body.base.query(place[None])
    away = body.radius + body.top
    step = body.radius
    if near.side[0] > 0 and body.gaps(place[None], step)[0] >= 0.0:
        return place
    while away < 2.0 * body.base.surface.size + 4.0 * body.radius:
        over = near.points[0] + (1.0 + CLEARANCE) * away * near.normals[0]
        if body.gaps(over[None], step)[0] >= 0.0:
            return np.asarray(over)
        away, step = away + step, 2.0 * step
    raise ContactError(f"no free place for a ball of {body.radius} m is found over {place.tolist()} m; start elsewhere")
