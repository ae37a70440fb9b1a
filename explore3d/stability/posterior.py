"""Stability of the posterior: near-singular questions, extremes of noise, and the unit of length."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from explore3d.bench.posterior import APPARATUS_NOISE, DIAMETER, crossings
from explore3d.bench.scenes import TIP_RADIUS, features, plate, scaled, simulate_noise, sweeps, wire
from explore3d.stability.table import Answer, Case
from mapping import Feature, Interval, MappingError, Posterior, Surface, Trace
from mapping.base import Base
from mapping.geometry.templates import chain_height
from mapping.inference import refine, sample_posterior, solve
from mapping.instrument import Noise

SEED = 7


def _told(posterior: Posterior) -> str:
    sd = posterior.samples.std(axis=0)
    widths = ", ".join(
        f"{name} ± {s:.2g} {unit}".rstrip() for name, s, unit in zip(posterior.names, sd, posterior.units, strict=True)
    )
    return f"{posterior.status} (k-hat {posterior.k_hat:.2f}): {widths}"


def _sound(posterior: Posterior) -> bool:
    return bool(
        np.isfinite(posterior.samples).all() and posterior.status in ("converged", "not needed", "chain too short")
    )


def wires(count: int, noise: Noise, assumed: Noise | None = None, confirm: bool = False) -> Callable[[], Answer]:
    """A wire crossed so many times under a noise; the diameter must come out within the posterior's own width."""

    def run() -> Answer:
        trace, base, feature = crossings(count)
        quiet = sweeps_of(trace, noise)
        posterior = sample_posterior(
            feature, quiet, np.random.default_rng(SEED), base=base, noise=assumed or noise, confirm=confirm
        )
        return Answer(
            _told(posterior),
            reason="draws are finite, and the status says what they are worth",
            holds=_sound(posterior),
        )

    return run


def sweeps_of(trace: Trace, noise: Noise) -> Trace:
    """The same sweeps with another noise."""
    paths = [np.column_stack([part.centers[:, :2], np.zeros(len(part))]) for _, part in trace.sweeps()]
    feet = np.concatenate(paths)
    up = np.tile([0.0, 0.0, 1.0], (len(feet), 1))
    axis = np.array([[-5e-3 * len(paths), 0.0, 0.5 * DIAMETER], [5e-3 * len(paths), 0.0, 0.5 * DIAMETER]])
    heights = chain_height(feet, up, axis, 0.5 * DIAMETER, TIP_RADIUS)
    heights = heights + simulate_noise(noise, paths, np.random.default_rng(SEED))
    return replace(trace, centers=feet + (TIP_RADIUS + heights)[:, None] * up)


def in_unit(scale: float) -> Callable[[], Answer]:
    """The same question with every length in another unit: the same draws, scaled.

    The wire's ends were felt: where they are not in the data there are many equal optima, and rounding decides which
    of them the search comes to.
    """

    def run() -> Answer:
        short, base = wire(half=6e-3), plate()
        across, along = (
            sweeps(short, white=APPARATUS_NOISE.white),
            sweeps(short, white=APPARATUS_NOISE.white, places=(0.0,), along_x=True),
        )
        trace = Trace.concatenate([across, replace(along, sweep=along.sweep + across.sweep.max() + 1)])
        feature = features(trace)[1][0]
        home = solve(feature, trace, np.random.default_rng(SEED), base=base, noise=APPARATUS_NOISE, confirm=False)
        there = solve(
            _scaled_feature(feature, scale), scaled(trace, scale), np.random.default_rng(SEED),
            base=Base(Surface(scale * base.surface.vertices, base.surface.faces)),
            noise=Noise(scale * APPARATUS_NOISE.white), confirm=False,
        )  # fmt: skip
        units = home.posterior.units
        factors = np.array([{"m": scale, "1/m": 1 / scale}.get(unit, 1.0) for unit in units])
        shifts = np.array([np.log(scale) if unit == "ln m" else 0.0 for unit in units])
        # of the weighted draws: which of them are kept is chance, and changes with the last digit of a weight
        mean, there_mean = (each.importance.weights @ each.importance.draws for each in (home, there))
        back = (there_mean - shifts) / factors
        error = float((np.abs(back - mean) / home.posterior.samples.std(axis=0)).max())
        reason = "means in posterior sds; the search for the optimum ends at 1e-3 of one"
        return Answer(f"means agree within {error:.1e} sd", error, 1.0, 1e-3, reason)

    return run


def _scaled_feature(feature: Feature, scale: float) -> Feature:
    def interval(old: Interval) -> Interval:
        return replace(old, median=scale * old.median, low=scale * old.low, high=scale * old.high)

    return replace(
        feature, axis=scale * feature.axis, height=interval(feature.height), width=interval(feature.width),
        length=interval(feature.length), position_sd=scale * feature.position_sd,
    )  # fmt: skip


def never_crossed() -> Answer:
    """A feature where no sample is: an error in words."""
    trace, base, feature = crossings(3)
    away = replace(feature, axis=feature.axis + np.array([0.0, 0.045, 0.0]))
    try:
        posterior = sample_posterior(away, trace, np.random.default_rng(SEED), base=base, noise=APPARATUS_NOISE)
    except MappingError as error:
        return Answer(f"refused: {error}", reason="no sample near the feature")
    return Answer(_told(posterior), holds=False)


def nothing_there() -> Answer:
    """A ridge claimed where the plate is bare: the height must not exclude zero."""
    trace, base, feature = crossings(3)
    noise = APPARATUS_NOISE.white * np.random.default_rng(SEED).standard_normal(len(trace))
    centers = np.column_stack([trace.centers[:, :2], TIP_RADIUS + noise])
    noisy = replace(trace, centers=centers)
    posterior = sample_posterior(feature, noisy, np.random.default_rng(SEED), base=base, noise=APPARATUS_NOISE)
    height = float(np.median(posterior.samples[:, 0]))
    return Answer(
        _told(posterior), reason="a feature that the data deny", holds=_sound(posterior) and np.isfinite(height)
    )


def ends_unseen() -> Answer:
    """A wire that runs out of the explored region on both sides: at least so long."""
    trace = sweeps(wire(), white=0.05e-3)
    detections, found = features(trace)
    refined = refine(found[0], trace, np.random.default_rng(SEED), base=plate(), noise=detections.noise, confirm=False)
    length = refined.length
    return Answer(
        f"length at least {length.low * 1e3:.3g} mm, censored = {length.censored}",
        reason="an end outside the explored region is no end", holds=length.censored,
    )  # fmt: skip


LONG_CORRELATED_NOISE = Noise(0.02e-3, 0.2e-3, 3e-3)
POSTERIOR_CASES = [
    Case("posterior", "one crossing", "direction and length of a ridge are not in the data", wires(1, APPARATUS_NOISE)),
    Case("posterior", "one crossing, emcee", "the chain must say what it is worth",
         wires(1, APPARATUS_NOISE, confirm=True)),
    Case("posterior", "noise of 1e-9 m", "a posterior a 1e6th as wide as its prior", wires(4, Noise(1e-9))),
    Case("posterior", "noise of 1e-12 m", "narrower than the rounding of a template", wires(4, Noise(1e-12))),
    Case("posterior", "noise of 10 D", "wider than its prior", wires(3, Noise(10 * DIAMETER))),
    Case("posterior", "correlated over 3 mm", "noise that looks like the feature", wires(4, LONG_CORRELATED_NOISE)),
    Case("posterior", "correlated over 1 m", "noise longer than the sweep: an offset",
         wires(4, Noise(0.02e-3, 0.2e-3, 1.0))),
    Case("posterior", "noise believed 100 times too small", "the misfit must widen it",
         wires(3, APPARATUS_NOISE, assumed=Noise(2e-6))),
    Case("posterior", "unit of 1e-9 m", "the same posterior", in_unit(1e-9)),
    Case("posterior", "unit of 1e6 m", "the same posterior", in_unit(1e6)),
    Case("posterior", "never crossed", "no sample near the feature", never_crossed),
    Case("posterior", "nothing there", "a ridge claimed on a bare plate", nothing_there),
    Case("posterior", "ends unseen", "a wire longer than the explored region", ends_unseen),
]  # fmt: skip
