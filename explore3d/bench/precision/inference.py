"""Error against time of what is inferred from a trace: detection, and the posterior of a feature."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np

from explore3d.bench.posterior import APPARATUS_NOISE, DIAMETER, crossings
from explore3d.bench.precision.work_precision import LeftOutMethod, Point, Stage, timed
from explore3d.bench.scenes import plate, sweeps, wire
from mapping import Feature, FloatArray, Trace
from mapping.base import Base
from mapping.detection import along_chord, curvature_features, detect
from mapping.inference import pose_problem, sample_posterior, solve
from mapping.inference.families import Surroundings

Result = list[Point | LeftOutMethod]

WHITE_NOISE = 0.2e-3
SWEEP_PLACES = np.linspace(-40e-3, 40e-3, 21)


def detection(quick: bool, peers: bool) -> Result:
    """Where a wire is crossed, from ever more of the samples: the matched filters, and the paper's thresholds."""
    whole = sweeps(wire(half=0.09), places=SWEEP_PLACES.tolist(), white=WHITE_NOISE)
    out: Result = []
    for keep in (64, 16, 4, 1):
        trace = whole.select(slice(None, None, keep))
        name = f"every {6 * keep} um"
        seconds, repeats, found = timed(partial(detect, trace, plate()))
        errors = [each.point[1] for each in found.crossings if each.kind == "convex"]
        _add(out, "matched filters (ours)", name, seconds, repeats, errors)
        for algorithm in (3, 4):
            seconds, repeats, errors = timed(partial(_by_threshold, trace, algorithm), 1)
            _add(out, f"the paper's algorithm {algorithm}", name, seconds, repeats, errors)
    why = "contact normals are needed; this trace has positions alone"
    return [*out, LeftOutMethod("detection", "the paper's algorithms 1 and 2", why)]


def _by_threshold(trace: Trace, algorithm: int) -> list[float]:
    """Places (m) of the convex curvature features of every sweep."""
    places = []
    for _, part in trace.sweeps():
        zero = along_chord(part, np.array([[part.centers[0, 0], 0.0, part.centers[0, 2]]]))[0]
        features = [each for each in curvature_features(part, algorithm) if each.sign > 0]
        places += [0.5 * (each.start + each.stop) - zero for each in features]
    return places


def _add(out: Result, method: str, setting: str, seconds: float, repeats: int, places: list[float]) -> None:
    good = [place for place in places if abs(place) < 3.6e-3]
    missed, false = len(SWEEP_PLACES) - len(good), len(places) - len(good)
    if missed > 0 or false > 0:
        why = f"{setting}: {max(missed, 0)} of {len(SWEEP_PLACES)} crossings missed, {false} invented"
        out.append(LeftOutMethod("detection", method, why))
    if good:
        error = float(np.sqrt(np.mean(np.square(good))))
        out.append(Point("detection", method, setting, seconds, error, repeats))


def posterior(quick: bool, peers: bool) -> Result:
    """Medians of a wire's posterior from one crossing pair, by importance sampling and by chains of growing length."""
    trace, base, feature = crossings(2)

    def fast(seed: int) -> FloatArray:
        rng = np.random.default_rng(seed)
        return sample_posterior(feature, trace, rng, base=base, noise=APPARATUS_NOISE, confirm=False).samples

    def chain(seed: int) -> FloatArray:
        rng = np.random.default_rng(seed)
        return sample_posterior(feature, trace, rng, base=base, noise=APPARATUS_NOISE, confirm=True).samples

    runs = [fast(seed) for seed in range(100, 108 if quick else 132)]
    spread = np.concatenate(runs).std(axis=0)
    reference = np.mean([np.median(run, axis=0) for run in runs], axis=0)
    clocked = [timed(partial(chain, seed), 1) for seed in range(200, 202 if quick else 208)]
    other = np.mean([np.median(run, axis=0) for _, _, run in clocked], axis=0)
    doubt = float((np.abs(reference - other) / spread).max())
    out: Result = [
        LeftOutMethod("posterior", "reference", f"importance sampling and emcee agree within {doubt:.2f} sd")
    ]

    def error(samples: FloatArray) -> float:
        return float(np.sqrt(np.mean(((np.median(samples, axis=0) - reference) / spread) ** 2)))

    def add(method: str, setting: str, seconds: float, draws: list[FloatArray]) -> None:
        typical = float(np.median([error(samples) for samples in draws]))
        out.append(Point("posterior", method, setting, seconds, typical, len(draws)))

    add("Laplace + PSIS (ours, the fast path)", "1000 draws", timed(lambda: fast(1))[0], [fast(k) for k in (1, 2, 3)])
    chains = [run for _, _, run in clocked]
    add("emcee, learnt proposal (ours)", "until converged", float(np.median([t for t, _, _ in clocked])), chains)
    out += _default_emcee(trace, base, feature, (100, 300, 1000) if quick else (100, 300, 1000, 3000, 10_000), error)
    why = "the width of the bins follows from the feature (x_c/30) and is no public setting"
    return [*out, LeftOutMethod("posterior", "bins", why)]


def _default_emcee(
    trace: Trace, base: Base, feature: Feature, steps: tuple[int, ...], error: Callable[[FloatArray], float]
) -> Result:
    """emcee as it comes: stretch moves, 32 walkers about the first guess, the first half thrown away.

    It samples the problem that ours settled on, of the likeliest section: another one has other parameters.
    """
    import emcee

    begin, rng = perf_counter(), np.random.default_rng(1)
    pose_problem(feature, Surroundings(trace, base, APPARATUS_NOISE))
    posing = perf_counter() - begin
    target = solve(feature, trace, rng, base=base, noise=APPARATUS_NOISE, confirm=False).problem.target
    start = target.shape.start + target.shape.step * rng.standard_normal((32, len(target.shape.start)))
    start = np.clip(start, target.low, target.high)
    sampler = emcee.EnsembleSampler(*start.shape, target.log_density, vectorize=True)
    sampler.random_state = np.random.RandomState(1).get_state()
    out: Result = []
    state, done, spent = start, 0, posing
    for count in steps:
        begin = perf_counter()
        state = sampler.run_mcmc(state, count - done, skip_initial_state_check=True)
        spent, done = spent + perf_counter() - begin, count
        samples = sampler.get_chain(discard=count // 2, flat=True)
        out.append(Point("posterior", "emcee, default moves", f"{count} steps of 32 walkers", spent, error(samples)))
    return out


INFERENCE_STAGES = (
    Stage("detection", "root mean square error of the place of a crossing (m)",
          f"The wire's own place; {len(SWEEP_PLACES)} crossings of {DIAMETER * 1e3:g} mm under 0.2 mm of white noise.",
          "More samples cost time and buy place: white noise averages out as their square root. The paper's thresholds "
          "on curvature see the same crossings with a larger error.", detection),
    Stage("posterior", "error of the medians, in standard deviations of the posterior",
          "Many runs of importance sampling, averaged; emcee confirms them independently.",
          "Ours first asks which section left the trace, which is most of their time; the chain of default moves is "
          "given that section, and approaches the medians slowly. A proposal learnt from importance sampling makes "
          "emcee a check that can be afforded.", posterior),
)  # fmt: skip
