"""Step feature: edges between two levels, from the places where sweeps went up or down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import Feature, Interval, Support
from mapping.assembly.branches import main_line
from mapping.assembly.lines import ONE_POINT, Around, mean_point, merged
from mapping.assembly.linking import groups
from mapping.detection import Crossing
from mapping.geometry.mesh import arclengths, distances
from mapping.inference.kinds import kind_made_of


def step_features(
    steps: Sequence[Crossing], features: Sequence[Feature], around: Around, scale: float
) -> list[Feature]:
    """Steps that no other feature explains; in an area at least two sweeps must agree on one."""
    free = [c for c in steps if not _explained(c, features, around.tip_radius)]
    lines = [[free[i] for i in members] for members in groups(free, around.inspection, scale)] if free else []
    return [_step(line, around) for line in lines if len({c.sweep for c in line}) > 1]


def _explained(step: Crossing, features: Sequence[Feature], tip_radius: float) -> bool:
    """True where a sweep ran on to a ridge, or along it: it goes up and down at the ridge's rims."""
    return any(
        distances(step.point[None], f.axis)[0] < 2 * np.sqrt(2 * tip_radius * abs(f.height.median)) + step.half_width
        for f in features
    )


def _step(line: list[Crossing], around: Around) -> Feature:
    half_width = float(np.median([c.half_width for c in line]))
    points = np.array([mean_point(cluster) for cluster in merged(line, ONE_POINT * half_width)])
    axis = main_line(points)
    height = float(np.median([abs(c.height) for c in line]))
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
    )
