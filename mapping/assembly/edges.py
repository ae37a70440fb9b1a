"""Edges: of the body that the base does not have, and steps between two levels.

Beyond a convex edge or a concave corner the body runs away from the base in a straight line, to the end of every sweep:
no crest and no step, but a hinge. Edges that the base has leave no height and are never seen here. Beyond the edge of a
step the body keeps to another level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.assembly.lines import ONE_POINT, Around, mean_point, merged
from mapping.assembly.linking import Inspection, groups, main_line, uphill
from mapping.detection import Crossing
from mapping.geometry.mesh import arclengths, distances, nearest_on
from mapping.geometry.templates import contact_half_width
from mapping.inference.configuration import NEIGHBOURHOOD_REACH
from mapping.inference.kinds import kind_made_of

# A stretch is straight if it bends by less than this share of its rise, once its first part is left out, where the
# ball rolls over the edge.
STRAIGHT_BEND_SHARE, ROLLING = 0.08, 0.35
EDGE_HEIGHT_SDS, LEAST_PLACES = 4.0, 8
# Places that a parabola needs, and one more that tells whether it fits
FEWEST_PARABOLA_PLACES = 4
# Hinges further from each other than so many tip radii belong to different edges.
SAME_EDGE = 2.0


@dataclass(frozen=True, eq=False)
class Hinge:
    """Where one sweep's height leaves the base: `point` (3,) m, `way` (3,) out along the sweep, `slope` signed."""

    crossing: Crossing
    point: FloatArray
    way: FloatArray
    slope: float


def edge_features(crossings: Sequence[Crossing], around: Around) -> tuple[list[Feature], list[Crossing]]:
    """Edges that at least two sweeps agree on, and the crossings that they do not explain."""
    crests = [c for c in crossings if c.kind in ("convex", "concave")]
    over = around.inspection.over_terraces  # stairs run off a base's lowest level in a line, too
    hinges = [h for c in crests if (h := _hinge(c, over)) is not None]
    features, rest = [], list(crossings)
    for group in _groups(hinges, SAME_EDGE * around.tip_radius):
        if len({h.crossing.sweep for h in group}) < 2:
            continue
        edge, out = _edge(group, around)
        features.append(edge)
        used = {id(h.crossing) for h in group}
        rest = [c for c in rest if id(c) not in used and not _beyond(c, edge, out, around.tip_radius)]
    return features, rest


def _hinge(crossing: Crossing, inspection: Inspection) -> Hinge | None:
    """The hinge of a sweep whose height runs off in a straight line to one of its ends."""
    own = inspection.of_sweep(crossing.sweep)
    points, heights = inspection.points[own], np.sign(crossing.height) * inspection.height[own]
    sd = float(np.median(inspection.sd[own]))
    for order in (slice(None), slice(None, None, -1)):
        place, height = points[order], heights[order]
        off = height > max(EDGE_HEIGHT_SDS * sd, 0.03 * height.max())
        count = int(off.argmin())
        if count < LEAST_PLACES:
            continue
        s = np.linalg.norm(place[:count] - place[0], axis=1)
        keep = s < (1 - ROLLING) * s[-1]
        if keep.sum() < FEWEST_PARABOLA_PLACES:  # a sweep that comes back to where it began
            continue
        bend, slope, start = np.polyfit(s[keep], height[:count][keep], 2)
        rise = abs(np.ptp(np.polyval([bend, slope, start], s[keep])))
        line = np.polyfit(s[keep], height[:count][keep], 1)
        straight = abs(bend) * np.ptp(s[keep]) ** 2 / 4 < STRAIGHT_BEND_SHARE * rise
        if straight and line[0] < 0 and rise > max(0.4 * line[1], 10 * sd):
            way = (place[0] - place[count - 1]) / np.linalg.norm(place[0] - place[count - 1])
            at = place[0] + way * line[1] / line[0]
            return Hinge(crossing, at, way, float(-line[0] * np.sign(crossing.height)))
    return None


def _groups(hinges: list[Hinge], distance: float) -> list[list[Hinge]]:
    """Hinges of one sign that are near each other, directly or through others."""
    groups: list[list[Hinge]] = []
    for hinge in hinges:
        near = [
            g
            for g in groups
            if g[0].slope * hinge.slope > 0
            and min(float(np.linalg.norm(other.point - hinge.point)) for other in g) < distance
        ]
        groups = [g for g in groups if g not in near] + [[hinge, *(h for g in near for h in g)]]
    return groups


def _edge(group: list[Hinge], around: Around) -> tuple[Feature, FloatArray]:
    """The edge through the hinges, moved by r tan(angle / 2) to where the faces of the body meet; the way out (3,)."""
    hinges = main_line(np.array([h.point for h in group]))
    chord = (hinges[-1] - hinges[0]) / max(float(np.linalg.norm(hinges[-1] - hinges[0])), 1e-300)
    normal = group[0].crossing.normal
    out = np.cross(chord, normal) * float(np.sign(np.cross(chord, normal) @ np.mean([h.way for h in group], axis=0)))
    tangents = [abs(h.slope) / max(float(abs(h.way @ out)), 0.2) for h in group]
    angle = float(np.arctan(np.median(tangents)))
    convex = group[0].slope < 0
    shift = around.tip_radius * np.tan(0.5 * angle) * (-1.0 if convex else 1.0)
    feet = around.base.foot(hinges + shift * out + around.tip_radius * normal, around.tip_radius)
    length = float(arclengths(feet.points)[-1])
    rise = around.tip_radius * float(np.tan(angle)) * (-1.0 if convex else 1.0)
    crossings = [h.crossing for h in group]
    edge = Feature(
        kind=kind_made_of("convex hinge" if convex else "concave hinge", line=True).name,
        axis=feet.points,
        normals=feet.normals,
        height=Interval.normal(rise, around.tip_radius * float(np.std(tangents)) / np.sqrt(len(group))),
        width=Interval(0.0, 0.0, 2 * abs(shift)),
        length=Interval(length, length, np.inf, censored=True),
        evidence=Support(float(np.sqrt(sum(c.snr**2 for c in crossings))), len(group), (around.detections.algorithm,)),
        curvature_feature=True,
        position_sd=float(np.median([c.position_sd for c in crossings])),
        notes=(f"the body turns by {np.degrees(angle):.1f} degrees; its height is given one tip radius beyond",),
        extra={"angle": angle},
    )
    return edge, out


def _beyond(crossing: Crossing, edge: Feature, out: FloatArray, tip_radius: float) -> bool:
    """True for what lies past the edge, where the base is no model of the body, or within half a tip radius of it."""
    offset = crossing.point - nearest_on(crossing.point[None], edge.axis)[0][0]
    return bool(offset @ out > 0 or np.linalg.norm(offset) < 0.5 * tip_radius)


def step_features(
    steps: Sequence[Crossing], features: Sequence[Feature], around: Around, scale: float
) -> list[Feature]:
    """Steps that no other feature explains; in an area at least two sweeps must agree on one."""
    free = [c for c in steps if between_levels(c, around.inspection) or not _explained(c, features, around.tip_radius)]
    lines = [[free[i] for i in members] for members in groups(free, around.inspection, scale)] if free else []
    return [_step(line, around) for line in lines if len({c.sweep for c in line}) > 1]


def between_levels(step: Crossing, inspection: Inspection) -> bool:
    """True where the base has one level before a step and another behind it, whatever stands upon its edge."""
    if not len(inspection.lowered):
        return False
    own = inspection.of_sweep(step.sweep)
    along = (inspection.points[own] - step.point) @ step.tangent
    level = (inspection.height - inspection.lowered)[own]
    before, behind = level[along < -step.half_width], level[along > step.half_width]
    return bool(len(before) and len(behind) and abs(behind[0] - before[-1]) > 0.5 * abs(step.height))


def _explained(step: Crossing, features: Sequence[Feature], tip_radius: float) -> bool:
    """True where a sweep ran on to a ridge, or along it: it goes up and down at the ridge's rims."""
    return any(
        distances(step.point[None], f.axis)[0] < 2 * np.sqrt(2 * tip_radius * abs(f.height.median)) + step.half_width
        for f in features
    )


def _step(line: list[Crossing], around: Around) -> Feature:
    half_width = float(np.median([c.half_width for c in line]))
    height = float(np.median([abs(c.height) for c in line]))
    # a sweep climbs to where it crossed the edge; over more than the window of an upright one would hold it is slanted
    upright = float(contact_half_width(min(height, around.tip_radius), 0.0, around.tip_radius))
    run = half_width - 0.5 * upright if half_width > NEIGHBOURHOOD_REACH * upright else None
    if run is not None:
        line = [replace(c, point=c.point - 0.5 * c.half_width * uphill(c)) for c in line]
    points = np.array([mean_point(cluster) for cluster in merged(line, ONE_POINT * half_width)])
    axis = main_line(points)
    sd = float(np.median([c.height_sd for c in line]) / np.sqrt(len(line)))
    length = float(arclengths(axis)[-1])
    slack = 2 * around.inspection.pitch
    normals = around.base.foot(axis + around.tip_radius * line[0].normal, around.tip_radius).normals
    return Feature(
        kind=kind_made_of("step", line=True).name,
        axis=axis,
        normals=normals,
        height=Interval.normal(height, sd),
        width=Interval(0.0, 0.0, 2 * half_width),
        length=Interval(length, length, length + slack),
        evidence=Support(float(np.sqrt(sum(c.snr**2 for c in line))), len(line), (around.detections.algorithm,)),
        curvature_feature=any(c.curvature_feature for c in line),
        position_sd=float(np.median([c.position_sd for c in line])),
        details=Details(high_side=_high_side(line, axis, normals), run=run),
    )


def _high_side(line: Sequence[Crossing], axis: FloatArray, normals: FloatArray) -> float:
    """+1 if the side of normal x tangent along an axis (K, 3) is the one that the sweeps rose to, else -1."""
    leg = np.array([np.linalg.norm(axis - c.point, axis=1).argmin() for c in line])
    way = axis[np.minimum(leg + 1, len(axis) - 1)] - axis[np.maximum(leg - 1, 0)]
    rise = (np.cross(normals[leg], way) * np.array([uphill(c) for c in line])).sum()
    return 1.0 if rise > 0.0 else -1.0
