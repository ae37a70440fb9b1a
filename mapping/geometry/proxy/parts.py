"""Parts: the closed forms of fine features as bodies, which a proxy touches: added to a base, or cut into it."""

from __future__ import annotations

from dataclasses import dataclass

from mapping import FloatArray


@dataclass(frozen=True, eq=False)
class Chain:
    """A ridge or a round bump: a chain of capsules whose crest stands over the base.

    Where a ridge ends it is rounded by half its radius: the middle of one that is cut square and one that goes on as a
    half ball.

    Args:
        axis: (K, 3) points of the base under the crest, m; one of a bump.
        normals: (K, 3) outward unit normals there.
        height: of the crest over the base, m, positive.
        radius: of the section, m, positive.
    """

    axis: FloatArray
    normals: FloatArray
    height: float
    radius: float


@dataclass(frozen=True, eq=False)
class Bar:
    """A ridge with a flat top and straight flanks, from upright walls (run 0) to a roof (top 0), or with round
    edges over upright walls; its ends are square. About a single point it is a bump, from a disc to a cone.

    Args:
        axis: (K, 3) points of the base under the middle, m; first equals last of a closed one.
        normals: (K, 3) outward unit normals there.
        height: of the top over the base, m, positive.
        top: width of the top, m, at least 0.
        run: how far each flank goes beside it, m, at least 0.
        shoulder: radius of its edges, m, at least 0, instead of a run; not all 0.
    """

    axis: FloatArray
    normals: FloatArray
    height: float
    top: float
    run: float
    shoulder: float = 0.0


@dataclass(frozen=True, eq=False)
class Bell:
    """A bump whose flank runs out, z = height (1 + u^2 / (p scale^2))^-p about the normal (theory equation 2.7).

    Args:
        point, normal: (3,) m, and the outward unit normal.
        height, scale: m, positive; exponent: p, positive, or below -1: it then ends at an edge without a kink.
    """

    point: FloatArray
    normal: FloatArray
    height: float
    scale: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Swell:
    """A ridge whose flanks run out: the section of a bell along an axis. An open one ends as halves of that bell.

    Args:
        axis: (K, 3) points of the base under the crest, m, K >= 2; first equals last of a closed one.
        normals: (K, 3) outward unit normals there.
        height, scale, exponent: as of a bell.
    """

    axis: FloatArray
    normals: FloatArray
    height: float
    scale: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Trench:
    """A groove or a pit: all of the base that is nearer to the axis than half the width, lowered, with upright walls.

    A groove ends square at the ends of its axis. Where several overlap, the deepest counts.

    Args:
        axis: (K, 3) points of the base, m; one of a pit; first equals last of a closed groove.
        normals: (K, 3) outward unit normals there.
        width, depth: m, positive.
    """

    axis: FloatArray
    normals: FloatArray
    width: float
    depth: float


@dataclass(frozen=True, eq=False)
class Terrace:
    """A step: the base on one side of an upright edge, raised.

    The record of a step says where the edge is and how high, not how far the higher level goes: it runs as far from
    the edge as the edge is long, then down on a ramp; so it does past the ends of the edge.

    Args:
        axis: (K, 3) points of the base under the edge, m, K >= 2.
        normals: (K, 3) outward unit normals there.
        height: m, positive.
        high_side: +1 if the side of normal x tangent is the higher one, else -1.
    """

    axis: FloatArray
    normals: FloatArray
    height: float
    high_side: float


Part = Chain | Bar | Bell | Swell | Trench | Terrace
