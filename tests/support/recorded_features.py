"""Made-up traces over features of known size on a plate, and what a detector would say of them."""

from __future__ import annotations

import numpy as np

from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates.shapes import chain_height
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, D = 10e-3, 0.65e-3
UP = np.array([0.0, 0.0, 1.0])
WHITE = Noise(0.1e-3)


def plate(half=0.1):
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0.0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def line(start, stop, spacing=12e-6):
    count = int(np.linalg.norm(np.subtract(stop, start)) / spacing) + 1
    return np.column_stack([np.linspace(start, stop, count), np.zeros(count)])


def record(paths, height_at, noise=WHITE, seed=0):
    """A trace over the plate: centres one radius and the feature's height above it, with white noise."""
    rng = np.random.default_rng(seed)
    feet = np.concatenate(paths)
    height = height_at(feet) + noise.white * rng.standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
    return Trace(np.arange(len(feet)) * 1e-3, feet + np.outer(TIP + height, UP), sweep, TIP)


def feature(kind, axis, height, width, crossings=4, sd=0.1e-3):
    axis = np.atleast_2d(np.asarray(axis, dtype=float))
    length = float(np.linalg.norm(axis[-1] - axis[0]))
    sizes = Interval.normal(height, 0.1 * abs(height)), Interval(width, 0.5 * width, 2 * width)
    evidence = Support(50.0, crossings)
    return Feature(kind, axis, np.tile(UP, (len(axis), 1)), *sizes, Interval.normal(length, 1e-3), evidence, True, sd)


def wire(ends, diameter=D):
    axis = np.asarray(ends, dtype=float) + 0.5 * diameter * UP
    up = lambda feet: np.tile(UP, (len(feet), 1))  # noqa: E731
    return lambda feet: chain_height(feet, up(feet), axis, 0.5 * diameter, TIP)


CROSSINGS = [line((x, -12e-3), (x, 12e-3)) for x in (-9e-3, -3e-3, 3e-3, 9e-3)]
SLIDES = [line((side * 5e-3, 0.0), (side * 24e-3, 0.0)) for side in (-1, 1)]
ENDS = [(-15e-3, 0.3e-3, 0), (16e-3, -0.2e-3, 0)]
GUESS = feature("ridge", [(-9e-3, 0.2e-3, 0), (9e-3, 0, 0)], 0.6e-3, 0.6e-3)


def inside(interval, truth, slack=0.0):
    return interval.low - slack <= truth <= interval.high + slack
