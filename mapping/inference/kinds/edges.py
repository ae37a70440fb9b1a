"""Edges of the body that the base does not have: they turn away from it, and have no closed-form trace."""

from __future__ import annotations

from mapping.inference.kinds.kind import Kind

CONVEX_EDGE = Kind(
    name="convex edge",
    plural="convex edges",
    sign=-1,  # beyond it the body falls away from the base
    line=True,
    made_of="convex hinge",
    words={"height": "deep", "length": "long"},
)
CONCAVE_CORNER = Kind(
    name="concave corner",
    plural="concave corners",
    sign=1,
    line=True,
    made_of="concave hinge",
    words={"height": "high", "length": "long"},
)
