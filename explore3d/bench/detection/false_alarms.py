"""False-alarm bench: sweeps over bodies without any detail, their own mesh as the base, must show nothing.

Every set of sweeps is one line of a JSONL file; what is already in the file is not run again.

    explore3d bench detect --bodies --store OUT.jsonl --seeds 100
"""

from __future__ import annotations

import itertools
import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from explore3d.bench.detection.detect import plate
from explore3d.bench.scenes import SAMPLE_SPACING, simulate_noise
from explore3d.scene import load_mesh
from mapping import FloatArray, Surface, Trace
from mapping.base import Base
from mapping.detection import detect
from mapping.geometry.contact import BallContact
from mapping.instrument import Noise

TIP_RADIUS = 0.01
# Enough to be counted: a hundred times the paper's.
COUNTABLE_ALARM_RATE = 1.0
NOISE_MODELS = {"none": Noise(0.0), "white": Noise(0.2e-3), "correlated": Noise(0.0, 0.2e-3, 1e-3)}
SWEEPS_PER_BODY = 3
# Steps of the path over steps across the body, up to which a body is swept: slopes of 66 degrees.
STEEP = 2.5


def sphere() -> Surface:
    """A sphere of 50 mm radius, 82 thousand faces."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.05)
    return Surface(ball.vertices, ball.faces)


def cylinder() -> Surface:
    """A cylinder of 40 mm radius along y."""
    import trimesh

    tube = trimesh.creation.cylinder(radius=0.04, height=0.2, sections=720)
    return Surface(tube.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0], tube.faces)


def torus() -> Surface:
    """A torus of radii 60 and 25 mm."""
    import trimesh

    ring = trimesh.creation.torus(major_radius=0.06, minor_radius=0.025, major_sections=360, minor_sections=180)
    return Surface(ring.vertices, ring.faces)


FEATURELESS_BODIES: dict[str, Callable[[], Surface]] = {
    "plane": lambda: plate().surface,
    "sphere": sphere,
    "cylinder": cylinder,
    "torus": torus,
}


@cache
def swept(body: str, mesh: Path | None = None) -> tuple[Base, Trace]:
    """The body as its own base, and noise-free sweeps of the ball over it from above, with contact normals."""
    surface = _scaled(mesh) if mesh else FEATURELESS_BODIES[body]()
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    half = 0.4 * (high - low)
    middle = 0.5 * (low + high)
    x = np.arange(middle[0] - half[0], middle[0] + half[0], SAMPLE_SPACING)
    parts = []
    for number, y in enumerate(middle[1] + half[1] * np.linspace(-0.6, 0.5, SWEEPS_PER_BODY)):
        above = np.column_stack([x, np.full(len(x), y), np.full(len(x), high[2] + 3 * TIP_RADIUS)])
        centers = BallContact(surface, TIP_RADIUS).first_contact(above, np.array([0.0, 0.0, -1.0])).centers
        centers = centers[np.isfinite(centers).all(axis=1)]
        steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
        # a ball let down from above jumps over overhangs and skips on steep flanks, where a sliding finger does
        # not: only the longest stretch that is sampled nearly evenly is a sweep
        cuts = np.concatenate([[0], np.flatnonzero(steps > STEEP * SAMPLE_SPACING) + 1, [len(centers)]])
        longest = int(np.diff(cuts).argmax())
        parts.append(_sweep(centers[cuts[longest] : cuts[longest + 1]], number))
    base, trace = Base(surface), Trace.concatenate(parts)
    return base, replace(trace, normals=base.foot(trace.centers, TIP_RADIUS).normals)


def run_case(body: str, noise: str, seed: int, mesh: Path | None = None) -> dict[str, Any]:
    """Crossings that detection reports on one set of noisy sweeps, and the path inspected, m."""
    base, clean = swept(body, mesh)
    rng = np.random.default_rng([seed, list(NOISE_MODELS).index(noise)])
    height = simulate_noise(NOISE_MODELS[noise], [clean.centers[clean.sweep == k] for k in np.unique(clean.sweep)], rng)
    trace = Trace(clean.t, clean.centers + height[:, None] * np.asarray(clean.normals), clean.sweep, TIP_RADIUS)
    found = detect(trace, base, false_alarms_per_metre=COUNTABLE_ALARM_RATE)
    return {
        "found": len(found.crossings),
        "metres": found.inspected_length,
        "heights": [c.height for c in found.crossings],
        "places": [list(map(float, c.point)) for c in found.crossings],
    }


def bench_false_alarms(
    seeds: int, out: Path, seconds: float = np.inf, mesh: Path | None = None
) -> list[dict[str, Any]]:
    """Run what is not yet in `out` and append it there, for no longer than some seconds; every record asked for.

    Args:
        mesh: a mesh file of any size to sweep over as well, or None.
    """
    bodies = [*FEATURELESS_BODIES, *([mesh.stem] if mesh else [])]
    done = {}
    if out.exists():
        for record in map(json.loads, out.read_text().splitlines()):
            done[record["body"], record["noise"], record["seed"]] = record
    begin, records = monotonic(), []
    for body, seed, noise in itertools.product(bodies, range(seeds), NOISE_MODELS):
        key = (body, noise, seed)
        if noise == "none" and seed > 0:
            continue
        if key not in done and monotonic() - begin < seconds:
            outcome = run_case(body, noise, seed, mesh if mesh and body == mesh.stem else None)
            done[key] = {"body": body, "noise": noise, "seed": seed} | outcome
            with out.open("a") as file:
                file.write(json.dumps(done[key]) + "\n")
        if key in done:
            records.append(done[key])
    return records


def false_alarm_lines(records: Iterable[dict[str, Any]]) -> Iterator[str]:
    """One line for each body and noise: false alarms beside what was asked for."""
    from scipy.stats import poisson

    sums: dict[tuple[str, str], list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])
    for record in records:
        total = sums[record["body"], record["noise"]]
        for k, value in enumerate((1, record["found"], record["metres"])):
            total[k] += value
    for (body, noise), (sets, found, metres) in sums.items():
        asked = 0.0 if noise == "none" else COUNTABLE_ALARM_RATE * metres
        most = int(poisson.ppf(0.99, asked)) if asked else 0
        verdict = "within" if found <= most else "ABOVE"
        yield (
            f"{body:10}{noise:12}{sets:5.0f} seeds{metres:9.1f} m{found:6.0f} false alarms, {asked:.1f} asked for"
            f" (at most {most}): {verdict}"
        )


def _scaled(mesh: Path) -> Surface:
    """A mesh scaled to 200 mm."""
    surface = load_mesh(mesh)
    return Surface(surface.vertices * (0.2 / float(np.ptp(surface.vertices, axis=0).max())), surface.faces)


def _sweep(centers: FloatArray, number: int) -> Trace:
    return Trace(
        10.0 * number + np.arange(len(centers)) / 5000.0,
        centers,
        np.full(len(centers), number, dtype=np.int64),
        TIP_RADIUS,
    )
