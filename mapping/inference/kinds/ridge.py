"""Ridge: a line of round section that stands on the base, such as a wire."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.inference.families import RidgeShape, Sizes, rounding_of
from mapping.inference.kinds.crests import Crest
from mapping.inference.kinds.lines import LineKind, Parameters, Traced
from mapping.inference.kinds.posing import height_prior, radius_prior
from mapping.inference.likelihood import Uniform


class Ridge(Crest, LineKind):
    """Capsule chains: course, rounding and places of the ends, height and log radius."""

    def shape(self, traced: Traced) -> RidgeShape:
        sizes, tip = traced.sizes, traced.tip_radius
        rounding = Parameters() if traced.chart.closed else Parameters((Uniform(0.0, 1.0),), (0.5,), (0.2,))
        section = Parameters(
            (height_prior(sizes), radius_prior(sizes, tip)),
            (sizes.height, float(np.log(sizes.radius))),
            (0.02 * sizes.height, 0.1),
        )
        whole = traced.laterals + rounding + traced.ends + section
        return RidgeShape(traced.window, traced.chart, traced.modes, tip, *whole.arrays)

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return float(np.log(4.0 * sizes.radius)), float(np.log(0.5 * sizes.height))

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        """The compiled form, over points instead of bins."""
        from mapping.geometry.templates import chain_heights

        radius = np.exp(truth[-1:])
        chain = shape.chains(truth[None], truth[-2:-1] - radius)
        whole = np.zeros(len(feet), dtype=np.int64), np.full(len(feet), chain.shape[1] - 1, dtype=np.int64)
        out = np.empty((1, len(feet)))
        point, rounding = np.full(len(feet), 1e-15), rounding_of(truth[-5:-4])
        chain_heights(
            feet, normals, np.zeros_like(normals), point, *whole, chain, radius, rounding, shape.tip_radius, out
        )
        return np.asarray(out[0])


RIDGE = Ridge(
    name="ridge",
    plural="ridges",
    sign=1,
    line=True,
    has_ends=True,
    made_of="convex",
    words={"height": "high", "length": "long"},
    colour=(0.80, 0.16, 0.22, 1.0),
    typical=(0.65e-3, 0.65e-3),  # the paper's wire
)
