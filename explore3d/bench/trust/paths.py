"""Paths over bodies whose meshes are known exactly: bare ones, and ones that wires lie on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes import Mesh, blob, blob_normals, cylinder as side_mesh, joined, sphere_mesh, tube
from explore3d.bench.trust.laws import Path
from mapping import FloatArray, Surface
from mapping.base import Base
from mapping.geometry.contact import BallContact

# Sweeps of one recording, their distance and the distance of their samples in tip radii, and their length, m
SWEEPS_SIDE_BY_SIDE, SWEEP_PITCH, SPACING_SHARE, PATH_LENGTH = 12, 0.5, 0.01, 0.22
# Wires of one recording: places that they scatter about, shares of the sweeps; and their diameters in tip radii
WIRE_PLACES, WIRE_DIAMETERS = (0.2, 0.5, 0.8), (0.02, 0.05)
# Sides of a wire's mesh. Between its edges, which are as far out as the round wire, a side stays behind by up to
# a (1 - cos(pi / n)), and the trace in the mean by D pi^2 / (12 n^2): 0.14 % of D with 24 sides and 0.009 % with 96.
# Heights are held against round wires, and one by nine crossings under the least level of all sets, 0.002 r, is known
# to 0.17 % (theory section 6.5).
WIRE_SIDES = 96
# Wires of so many draws lie on each body
WIRE_DRAWS = 4


@dataclass(frozen=True, eq=False)
class Body:
    """A body that sweeps run over side by side.

    Args:
        mesh: of the body.
        at: (N, 3) points of it, and (N, 3) directions out of it that the ball comes from, at places (N,) along and (N,)
            across the sweeps, m.
    """

    mesh: Mesh
    at: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


def plane(size: float) -> Body:
    """A plate."""
    side = 0.5 * PATH_LENGTH + size
    corners = side * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])

    def at(along: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.column_stack([along, across, 0.0 * along]), np.tile([0.0, 0.0, 1.0], (len(along), 1))

    return Body((corners, np.array([[0, 1, 2], [0, 2, 3]])), at)


def cylinder(size: float) -> Body:
    """A cylinder that is swept around."""

    def at(along: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn = along / size
        out = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
        return size * out + across[:, None] * [0.0, 0.0, 1.0], out

    return Body(side_mesh(size, 0.25), at)


def _star(shape: Callable[[FloatArray], FloatArray], normals: Callable[[FloatArray], FloatArray], size: float) -> Body:
    """A body that every direction from its middle meets once, swept along circles about z."""
    unit, faces = sphere_mesh(6)

    def at(along: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn, rise = along / size, across / size
        ways = np.column_stack([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
        return shape(ways), normals(ways)

    return Body((shape(unit), faces), at)


def sphere(size: float) -> Body:
    """A ball."""
    return _star(lambda ways: size * ways, lambda ways: ways, size)


def free_form(size: float) -> Body:
    """The benches' free form."""
    return _star(lambda ways: size / 0.045 * blob(ways), blob_normals, size)


@dataclass(frozen=True, eq=False)
class Wire:
    """A round wire that lies on a body.

    Args:
        axis: (K, 3) where it touches the body, m.
        up: (K, 3) directions out of the body there.
        diameter: m.
    """

    axis: FloatArray
    up: FloatArray
    diameter: float

    @property
    def mesh(self) -> Mesh:
        """With round ends."""
        middle = self.axis + 0.5 * self.diameter * self.up
        return tube(middle, self.up, 0.5 * self.diameter, WIRE_SIDES, WIRE_SIDES // 4)


def wires_on(body: Body, tip_radius: float, draw: tuple[int, ...]) -> list[Wire]:
    """Wires across some of the sweeps over a body; `draw` is the seed of their places, lengths and diameters."""
    rng, wires = np.random.default_rng(draw), []
    for share in WIRE_PLACES:
        diameter = tip_radius * rng.uniform(*WIRE_DIAMETERS)
        place = (share + rng.uniform(-0.05, 0.05) - 0.5) * PATH_LENGTH
        low, high = SWEEP_PITCH * tip_radius * np.array([rng.uniform(-4.5, -2.5), rng.uniform(1.5, 4.5)])
        across = np.linspace(low, high, 321)
        axis, up = body.at(place + rng.uniform(-0.3, 0.3) * across, across)
        wires.append(Wire(axis, up, diameter))
    return wires


TRUST_BODIES: dict[str, Callable[[float], Body]] = {
    "plane": plane,
    "cylinder": cylinder,
    "sphere": sphere,
    "free form": free_form,
}


@lru_cache(maxsize=16)
def _body(name: str, size: float) -> tuple[Body, Surface]:
    body = TRUST_BODIES[name](size)
    return body, Surface(*body.mesh)


@lru_cache(maxsize=16)
def bare_path(name: str, size: float, tip_radius: float) -> tuple[Path, Base]:
    """Sweeps over a body without a feature, and the body as its own base.

    Args:
        name: of TRUST_BODIES.
        size: radius of round bodies, m.
        tip_radius: m.
    """
    body, surface = _body(name, size)
    return _felt(body, surface, Base(surface), tip_radius)


@lru_cache(maxsize=16)
def wired_path(
    name: str, size: float, tip_radius: float, draw: tuple[int, ...]
) -> tuple[Path, Base, tuple[TrueFeature, ...], tuple[FloatArray, ...]]:
    """The same over a body that wires lie on, across some of the sweeps; these wires, and where sweeps meet them.

    A sweep crosses a wire where the ball's centre is over it, lowered on to the bare body's trace: the foot on facets
    stays behind at an edge that the ball rolls over, by r sin(0.5 deg) = 35 um for r = 4 mm where they meet at a
    degree. A wire lies where it lies, and is as high as it stands over the facets: the round body's own surface is up
    to 2 um over them where its radius is 45 mm.

    Args:
        draw: seed of the wires (see `wires_on`).
    """
    body, surface = _body(name, size)
    base, drawn, truth, crests = Base(surface), wires_on(body, tip_radius, draw), [], []
    for wire in drawn:
        crest = base.foot(wire.axis + (wire.diameter + tip_radius) * wire.up, tip_radius)
        height = float(crest.height.mean())
        truth.append(TrueFeature("ridge", base.foot(wire.axis, tip_radius).points, height, wire.diameter))
        crests.append(crest.points + tip_radius * crest.normals)
    path, _ = _felt(body, joined(body.mesh, *(wire.mesh for wire in drawn)), base, tip_radius)
    return path, base, tuple(truth), tuple(crests)


def _felt(body: Body, surface: Surface, base: Base, tip_radius: float) -> tuple[Path, Base]:
    """Where the ball rests when it comes from outside."""
    spacing = SPACING_SHARE * tip_radius
    along = np.arange(-0.5 * PATH_LENGTH, 0.5 * PATH_LENGTH, spacing)
    across = SWEEP_PITCH * tip_radius * (np.arange(SWEEPS_SIDE_BY_SIDE) - 0.5 * (SWEEPS_SIDE_BY_SIDE - 1))
    points, out = body.at(np.tile(along, SWEEPS_SIDE_BY_SIDE), np.repeat(across, len(along)))
    contacts = BallContact(surface, tip_radius).first_contact(points + 4.0 * tip_radius * out, -out)
    normals = np.asarray(base.foot(contacts.centers, tip_radius).normals)
    sweep = np.repeat(np.arange(SWEEPS_SIDE_BY_SIDE), len(along))
    return Path(np.array(contacts.centers), normals, sweep, spacing, tip_radius), base
