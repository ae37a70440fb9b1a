"""Posterior bench: effective samples per second, against emcee's default settings, and how the cost grows.

All ratios come from one run on one machine: absolute times say as much about the machine as about the program.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from explore3d.bench.scenes import SAMPLE_SPACING, simulate_noise
from mapping import Feature, Interval, Support, Surface, Trace
from mapping.base import Base
from mapping.geometry.templates import chain_height
from mapping.inference import Solution, pose_problem, solve_problem
from mapping.inference.families import PosteriorProblem, Surroundings
from mapping.instrument import Noise

TIP_RADIUS = 10e-3
DIAMETER = 0.65e-3
APPARATUS_NOISE = Noise(0.2e-3)
# Half of the paper's sweep of 3300 samples at 6 um.
HALF_SWEEP = 9.9e-3


@dataclass(frozen=True)
class Timing:
    """What one way of sampling gave.

    Args:
        name: of the way.
        seconds: from trace to draws.
        ess: effective number of draws.
        status: of the chain.
        bins: binned samples in the likelihood.
        samples: raw samples in the window.
    """

    name: str
    seconds: float
    ess: float
    status: str
    bins: int
    samples: int

    @property
    def rate(self) -> float:
        """Effective draws per second."""
        return self.ess / self.seconds


def crossings(count: int, elsewhere: int = 0) -> tuple[Trace, Base, Feature]:
    """A wire on a plate crossed `count` times, 3300 samples each, and `elsewhere` samples far from it."""
    half = 0.5 * 10e-3 * max(count, 1) + 0.05
    corners = np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    places = (np.arange(count) - 0.5 * (count - 1)) * 10e-3
    along = np.arange(-HALF_SWEEP, HALF_SWEEP, SAMPLE_SPACING)
    paths = [np.column_stack([np.full(len(along), x), along, np.zeros(len(along))]) for x in places]
    feet = np.concatenate(paths)
    up = np.tile([0.0, 0.0, 1.0], (len(feet), 1))
    reach = max(5e-3, 0.5 * float(np.ptp(places)) + 4e-3)
    axis = np.array([[-reach, 0.0, 0.5 * DIAMETER], [reach, 0.0, 0.5 * DIAMETER]])
    rng = np.random.default_rng(1)
    heights = chain_height(feet, up, axis, 0.5 * DIAMETER, TIP_RADIUS) + simulate_noise(APPARATUS_NOISE, paths, rng)
    centers = feet + (TIP_RADIUS + heights)[:, None] * up
    sweep = np.repeat(np.arange(count), len(along))
    if elsewhere:
        far = np.column_stack([rng.uniform(-half, half, elsewhere), np.full(elsewhere, half), np.zeros(elsewhere)])
        centers = np.concatenate([centers, far[np.argsort(far[:, 0])] + TIP_RADIUS * up[0]])
        sweep = np.concatenate([sweep, np.full(elsewhere, count)])
    trace = Trace(2e-4 * np.arange(float(len(centers))), centers, sweep, TIP_RADIUS)
    ends = axis[:, :] * np.array([0.7, 1.0, 0.0])
    sizes = Interval.normal(DIAMETER, 0.05e-3), Interval(DIAMETER, 0.3e-3, 1e-3), Interval.normal(2 * reach, 5e-3)
    guess = ends if count > 1 else np.zeros((1, 3))
    feature = Feature("ridge", guess, up[: len(guess)], *sizes, Support(50.0, count), True, 0.1e-3)
    return trace, base, feature


def timed(name: str, trace: Trace, base: Base, feature: Feature, confirm: bool) -> Timing:
    """Trace to draws by the project's way, the first call (compilation, imports) not counted."""

    def once() -> Solution:
        problem = pose_problem(feature, Surroundings(trace, base, APPARATUS_NOISE))
        return solve_problem(problem, np.random.default_rng(1), confirm=confirm)

    once()
    seconds, solution = _clocked(once)
    window, posterior = solution.problem.window, solution.posterior
    return Timing(name, seconds, posterior.ess, posterior.status, len(window), window.samples)


def _clocked(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def default_emcee(trace: Trace, base: Base, feature: Feature, steps: int = 2000) -> Timing:
    """emcee as it comes: stretch moves, 32 walkers about the first guess, one template a call, no proposal learnt."""
    import emcee

    problem: PosteriorProblem = pose_problem(feature, Surroundings(trace, base, APPARATUS_NOISE))
    target, rng = problem.target, np.random.default_rng(1)
    start = target.shape.start + target.shape.step * rng.standard_normal((32, len(target.shape.start)))
    start = np.clip(start, target.low, target.high)

    def run() -> Any:
        sampler = emcee.EnsembleSampler(*start.shape, lambda theta: float(target.log_density(theta[None])[0]))
        sampler.run_mcmc(start, steps, skip_initial_state_check=True)
        return sampler

    seconds, sampler = _clocked(run)
    tau = float(np.max(sampler.get_autocorr_time(tol=0, quiet=True)))
    status = "converged" if steps > 100 * tau else "chain too short"
    window = problem.window
    return Timing("emcee, default", seconds, 32 * steps / tau, status, len(window), window.samples)


def bench_posterior(report: Callable[[Timing], None] = lambda timing: None) -> list[Timing]:
    """The acceptance lines on speed: one crossing and five, fast path and emcee, defaults, a long log."""
    timings = []

    def keep(timing: Timing) -> None:
        timings.append(timing)
        report(timing)

    one = crossings(1)
    keep(timed("1 crossing, importance sampling", *one, confirm=False))
    keep(timed("1 crossing, emcee", *one, confirm=True))
    keep(default_emcee(*one))
    for count in (2, 4, 8, 16):
        keep(timed(f"{count} crossings, emcee", *crossings(count), confirm=True))
    keep(timed("4 crossings in a log of 1e6 samples", *crossings(4, 1_000_000), confirm=True))
    return timings
