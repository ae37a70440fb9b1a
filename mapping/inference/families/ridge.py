"""RidgeShape: a ridge of round section along a curve on the base."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray, IntArray
from mapping.geometry.templates import round_outline
from mapping.inference.curves import Chart, CurveModes, Mouth, laid_beyond, mouths_of
from mapping.inference.likelihood import Prior, Window

# A bin looks at the legs of the chart within this share of a tip radius of the one nearest to the ball's centre: an
# axis that is turned a little against the chart is nearest at a place a little further along.
LOOK_AROUND = 0.1


@dataclass(frozen=True, eq=False)
class RidgeShape:
    """Capsule chains: lateral modes of the axis, rounding and places of its two ends, height and log radius.

    An end is where the crest ends; beyond it the body is cut square (rounding 0) or goes on as a hemisphere (1): the
    two differ by 0.05 mm in the place of the end of the paper's wire, so what is not known of it is marginalised.
    The ends are distances along one curve, each with its own range, so they cannot swap. A closed ridge has none.

    Args:
        window: the bins.
        chart: the reference curve on the base, longer than the ridge.
        modes: lateral course of the axis over the chart.
        tip_radius: radius of the fingertip, m.
        priors, start, step: as in `Shape`.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("end rounding", "start", "end")
        return (*self.modes.names, *ends, "height", "log radius")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("", "m", "m")
        return (*self.modes.units, *ends, "m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import chain_heights

        window = self.window
        radius = np.exp(theta[:, -1])
        out = np.empty((len(theta), len(window)))
        first, last = self._candidates
        chain_heights(
            window.feet,
            window.normals,
            window.tangents,
            window.half,
            first,
            last,
            self.chains(theta, theta[:, -2] - radius),
            radius,
            np.ones(len(theta)) if self.chart.closed else rounding_of(theta[:, -5]),
            self.tip_radius,
            out,
        )
        height = np.ascontiguousarray(theta[:, -2])
        laid_beyond(self.mouths, out, theta, self.names, self.tip_radius, lambda _: round_outline(height, radius))
        return out

    @cached_property
    def mouths(self) -> tuple[Mouth, ...]:
        """Where edges of the body cut it off."""
        return mouths_of(self.window, self.chart, self.modes, self.tip_radius)

    def chains(self, theta: FloatArray, lift: FloatArray) -> FloatArray:
        """(W, K, 3) axes at `lift` (W,) over the base, m; vertices beyond an end stand at the end."""
        from mapping.inference.curves import axes_about

        chart, modes = self.chart, self.modes
        return np.asarray(
            axes_about(
                chart.s,
                self._crest_points,
                chart.laterals,
                chart.normals,
                chart.bend,
                self._basis,
                modes.middle,
                modes.reach,
                np.ascontiguousarray(theta[:, : modes.count]),
                np.ascontiguousarray(lift),
                np.zeros((0, 2)) if chart.closed else np.ascontiguousarray(theta[:, -4:-2]),
            )
        )

    @cached_property
    def _crest_points(self) -> FloatArray:
        """(K, 3) the chart's points, raised so that the legs between them lie on the base in the mean, m.

        A chord of length c sags by k c^2 / 8 in its middle and by two thirds of that in the mean; unmended, the mug's
        ridge of 0.8 mm came out 3 um too high.
        """
        chart = self.chart
        legs = np.diff(chart.s)
        beside = np.concatenate(
            [legs[-1:] if chart.closed else legs[:1], legs, legs[:1] if chart.closed else legs[-1:]]
        )
        square = 0.5 * (beside[:-1] ** 2 + beside[1:] ** 2)
        return np.asarray(chart.points + (chart.bend_along * square / 12.0)[:, None] * chart.normals)

    @cached_property
    def _basis(self) -> FloatArray:
        return np.ascontiguousarray(self.modes.basis(self.chart.s))

    @cached_property
    def _candidates(self) -> tuple[IntArray, IntArray]:
        # The ball touches near its centre's own place along the chart: where the body is bent the foot's lies
        # elsewhere, by r times the sine of the normal's lean along the chart.
        window = self.window
        leg = self.chart.coordinates(window.feet + self.tip_radius * window.normals)[2]
        neighbours = 1 + int(LOOK_AROUND * self.tip_radius / float(np.diff(self.chart.s).mean()))
        return np.maximum(leg - neighbours, 0), np.minimum(leg + 1 + neighbours, len(self.chart.s) - 1)


def rounding_of(turn: FloatArray) -> FloatArray:
    """Rounding 0 to 1 of an end from a parameter that is uniform on 0 to 1.

    A third each are square, round, and something between: what is made is mostly one of the first two, and stands at
    the rim of what the data leave likely where all roundings are thought to be.
    """
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(3.0 * turn - 1.0, 0.0, 1.0)))
