"""The experiment of the paper's section 4.2.2 simulated: four algorithms on a wire on a tilted plate.

A 10 mm hemisphere rolls or slides over a wire on a plate tilted by 45 degrees at 30 mm/s, sampled at 5 kHz; the centre
is known to 0.2 mm, the contact's place to 0.5 mm and its angle to 1 degree. Figure 7 shows what is recorded, figure 8
what each algorithm of figure 4 makes of it; the table counts over seeds what each finds of the wire's {-}{+}{-}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.bench.scenes import joined, tube
from explore3d.pictures import BAND, ESTIMATED, FAINT, INK, MUTED, TRACED, TRUTH, new_figure, png, styled
from hw import Move
from hw.simulated import SimulatedFinger
from mapping import FloatArray, Surface, Trace
from mapping.detection import along_chord, curvature_profile
from mapping.geometry.mesh import write_whole

TIP_RADIUS, SAMPLE_RATE, SPEED, FORCE = 10e-3, 5000.0, 0.03, 1.0
CENTRE, CONTACT, ANGLE = 0.2e-3, 0.5e-3, np.radians(1.0)
TILT = np.radians(45.0)
WIRES = (0.5e-3, 0.65e-3, 1.0e-3, 1.5e-3)
WIRE = 0.65e-3
# A slide is as long as one likes; a roll ends where the contact leaves the tip's field of +-75 degrees.
MOTION_LENGTHS = {"rolling": 2 * np.radians(75.0) * TIP_RADIUS, "sliding": 60e-3}
ALGORITHM_NAMES = {
    1: "1: surface from contacts",
    2: "2: derivative of the normal",
    3: "3: traced surface",
    4: "4: surface from the trace",
}
# Algorithm 2 with the threshold that the paper gives for all surfaces, which no convex trace can pass.
PAPERS = 20
ALGORITHM_COLUMNS = {**ALGORITHM_NAMES, PAPERS: "2 with the threshold 1/r"}
HALF_PLATE = 50e-3
# Facets so narrow that even the finest fit spans several.
WIRE_FACETS = 720


@dataclass(frozen=True)
class Finding:
    """What an algorithm finds of a wire, over seeds.

    Args:
        motion: rolling or sliding.
        wire: diameter, m.
        algorithm: number in figure 4, or PAPERS.
        noise: False for a finger without errors.
        convex: share of the crossings where the crest is found.
        concave: share of the two interference points, one on either side, that are found.
        false: features elsewhere, per metre of path.
    """

    motion: str
    wire: float
    algorithm: int
    noise: bool
    convex: float
    concave: float
    false: float


@cache
def tilted_plate(wire: float) -> Surface:
    """A plate through the origin, tilted about y, with a wire of that diameter along y, m."""
    corners = HALF_PLATE * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    axis = np.array([[0.0, -0.8 * HALF_PLATE, wire / 2], [0.0, 0.8 * HALF_PLATE, wire / 2]])
    flat = joined(
        (corners, np.array([[0, 1, 2], [0, 2, 3]])), tube(axis, np.array([0.0, 0.0, 1.0]), wire / 2, WIRE_FACETS)
    )
    return Surface(flat.vertices @ _tilt().T, flat.faces)


def crossing(motion: str, wire: float, seed: int | None = 0) -> Trace:
    """One sweep up the slope across the wire, with contact data; seed None for a finger without errors.

    The tip comes from straight above, as the paper's did, so that the plate touches it 45 degrees off its pole.
    """
    noise = {} if seed is None else {"white": CENTRE, "contact": CONTACT, "angle": float(ANGLE), "seed": seed}
    settings: dict[str, Any] = noise | {"rate": SAMPLE_RATE, "contact_data": True}
    with SimulatedFinger(object=tilted_plate(wire), tip_radius=TIP_RADIUS, **settings) as finger:
        half = MOTION_LENGTHS[motion] / 2
        path = np.array([[-half, 0.0, TIP_RADIUS], [half, 0.0, TIP_RADIUS]]) @ _tilt().T
        return finger.execute(Move(path, np.array([0.0, 0.0, -1.0]), SPEED, FORCE))


def findings(wires: Sequence[float] = WIRES, seeds: int = 20) -> list[Finding]:
    """Every algorithm on every wire and motion, without errors and with the apparatus' errors over some seeds."""
    found = []
    for motion in MOTION_LENGTHS:
        for wire in wires:
            for noise in (False, True):
                traces = [crossing(motion, wire, seed) for seed in range(seeds)] if noise else [_exact(motion, wire)]
                for algorithm in ALGORITHM_COLUMNS:
                    counts = np.mean([_counted(trace, wire, algorithm) for trace in traces], axis=0)
                    false = float(counts[2]) / MOTION_LENGTHS[motion]
                    found.append(Finding(motion, wire, algorithm, noise, float(counts[0]), float(counts[1]), false))
    return found


def _exact(motion: str, wire: float) -> Trace:
    return crossing(motion, wire, None)


def _counted(trace: Trace, wire: float, algorithm: int) -> tuple[float, float, int]:
    """Crest found (0 or 1), share of the two interference points found, and features elsewhere."""
    profile = curvature_profile(trace, 2 if algorithm == PAPERS else algorithm)
    if algorithm == PAPERS:
        profile = replace(profile, convex=1 / TIP_RADIUS)
    middle = float(along_chord(trace, np.array([[0.0, 0.0, 0.0]]))[0])
    # the kinks of the trace stand where the ball touches plate and wire at once (theory section 4)
    reach = np.sqrt(2 * TIP_RADIUS * wire)
    blur = 2 * profile.half_width + 3 * (CONTACT if algorithm == 1 else CENTRE)
    convex, sides, elsewhere = False, set(), 0
    for feature in profile.features:
        offset = feature.place - middle
        if feature.sign > 0 and abs(offset) < reach + blur:
            # an overshoot beside a kink is not the crest
            convex |= feature.start - blur < middle < feature.stop + blur
        elif feature.sign < 0 and abs(abs(offset) - reach) < blur:
            sides.add(offset > 0)
        else:
            elsewhere += 1
    return float(convex), len(sides) / 2, elsewhere


def findings_table(found: Sequence[Finding]) -> str:
    """The findings as a table in markdown: one line a motion and wire, one column an algorithm."""
    head = "| motion | wire | errors | " + " | ".join(ALGORITHM_COLUMNS.values()) + " |"
    lines = [head, "|" + "---|" * (3 + len(ALGORITHM_COLUMNS))]
    for motion, wire, noise in dict.fromkeys((f.motion, f.wire, f.noise) for f in found):
        cells = []
        for algorithm in ALGORITHM_COLUMNS:
            f = next(f for f in found if (f.motion, f.wire, f.noise, f.algorithm) == (motion, wire, noise, algorithm))
            cells.append(f"+ {100 * f.convex:.0f} %, - {100 * f.concave:.0f} %, {f.false:.1f} false/m")
        errors = "apparatus" if noise else "none"
        lines.append(f"| {motion} | {1e3 * wire:g} mm | {errors} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def write_apparatus(out: Path, seeds: int = 20) -> tuple[list[Path], list[Finding]]:
    """Write figures 7 and 8 and the table into a folder, which is made if absent; the files, and what the table holds.

    Raises:
        OSError: the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, draw in (("figure7_apparatus", recorded), ("figure8_algorithms", compared)):
        with styled():
            written.append(write_whole(out / f"{name}.png", png(draw())))
    found = findings(seeds=seeds)
    return [*written, write_whole(out / "section_4_2_2.md", _explained(findings_table(found)))], found


def recorded() -> Any:
    """Figure 7: centres, contact points and contact angles of one crossing, rolled and slid."""
    figure = new_figure(9.0, 6.2)
    panels = figure.subplots(2, 2, width_ratios=[MOTION_LENGTHS["rolling"], MOTION_LENGTHS["sliding"]], sharex="col")
    for column, motion in enumerate(MOTION_LENGTHS):
        noisy, exact = crossing(motion, WIRE), _exact(motion, WIRE)
        over, under = panels[:, column]
        for trace, centre, contact, size in ((noisy, TRACED, BAND, 1.0), (exact, INK, ESTIMATED, 0.0)):
            assert trace.normals is not None and trace.contacts is not None
            style: dict[str, Any] = {"ls": "", "marker": ".", "ms": size} if size else {"lw": 1.3}
            word = "measured" if size else "true"
            for points, colour, what in ((trace.contacts, contact, "contact"), (trace.centers, centre, "tip centre")):
                x, z = 1e3 * _on_plate(points).T
                order = np.argsort(x) if not size else slice(None)
                over.plot(x[order], z[order], color=colour, label=f"{what}, {word}", **style)
            tangent, normal = trace.normals @ _tilt()[:, 0], trace.normals @ _tilt()[:, 2]
            under.plot(
                1e3 * _on_plate(trace.centers)[:, 0], np.degrees(np.arctan2(tangent, normal)), color=centre, **style
            )
        over.set_title(motion)
        under.set_xlabel("along the plate [mm]")
        under.set_ylim(-26, 26)
    figure.suptitle(f"Figure 7.  Across a {1e3 * WIRE:g} mm wire on a plate at 45 degrees", color=MUTED, fontsize=9.5)
    panels[0, 0].set_ylabel("above the plate [mm]")
    panels[1, 0].set_ylabel("contact angle [degrees]")
    handles, labels = panels[0, 1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, markerscale=6)
    return figure


def compared() -> Any:
    """Figure 8: the curvature that each algorithm tests, its thresholds, and the features that it reports."""
    figure = new_figure(9.0, 8.6)
    panels = figure.subplots(
        len(ALGORITHM_NAMES), 2, sharex="col", width_ratios=[MOTION_LENGTHS["rolling"], MOTION_LENGTHS["sliding"]]
    )
    for column, motion in enumerate(MOTION_LENGTHS):
        noisy = crossing(motion, WIRE)
        middle = float(along_chord(noisy, np.array([[0.0, 0.0, 0.0]]))[0])
        for row, algorithm in enumerate(ALGORITHM_NAMES):
            axes, profile = panels[row, column], curvature_profile(noisy, algorithm)
            axes.axhspan(profile.concave * TIP_RADIUS, profile.convex * TIP_RADIUS, color=FAINT, lw=0)
            axes.plot(1e3 * (profile.s - middle), profile.curvature * TIP_RADIUS, color=INK, lw=1.1)
            for feature in profile.features:
                colour = ESTIMATED if feature.sign > 0 else TRACED
                axes.axvspan(
                    1e3 * (feature.start - middle), 1e3 * (feature.stop - middle), color=colour, alpha=0.35, lw=0
                )
            for side in (-1, 1):
                axes.axvline(1e3 * side * np.sqrt(2 * TIP_RADIUS * WIRE), color=TRUTH, lw=0.8, ls=(0, (3, 2)))
            axes.set_ylim(*(np.array([-1.15, 1.15]) * max(1.6, float(np.abs(profile.curvature * TIP_RADIUS).max()))))
            axes.set_title(f"{motion}, {ALGORITHM_NAMES[algorithm]}")
        panels[-1, column].set_xlabel("along the plate, from the wire [mm]")
    for axes in panels[:, 0]:
        axes.set_ylabel("curvature × r")
    figure.suptitle(
        "Figure 8.  Red: convex features, blue: concave; grey: below threshold; dashed: the trace's true kinks",
        color=MUTED,
        fontsize=9.5,
    )
    return figure


def _tilt() -> FloatArray:
    """Rotation about y that lifts the plate's x axis; its columns are the plate's axes."""
    c, s = np.cos(TILT), np.sin(TILT)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def _on_plate(points: FloatArray) -> FloatArray:
    """(N, 2) coordinates along and above the plate."""
    return np.asarray((points @ _tilt())[:, [0, 2]])


def _explained(table: str) -> str:
    return (
        "# The four algorithms on the simulated apparatus (the paper's section 4.2.2)\n\n"
        "Tip radius 10 mm, 5 kHz, 30 mm/s, plate at 45 degrees; centre +-0.2 mm, contact +-0.5 mm, angle +-1 degree, "
        "white, as standard deviations. `+` share of crossings whose crest is found, `-` share of the two "
        "interference points beside it, and features elsewhere per metre.\n\n" + table
    )
