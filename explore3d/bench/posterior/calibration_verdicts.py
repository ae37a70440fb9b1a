"""Verdicts on calibration: coverage, rank histograms, and the record that is kept of a campaign."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from explore3d.bench.posterior.calibration import CALIBRATED_KINDS, CALIBRATED_NOISES, Row
from mapping import FloatArray
from mapping.geometry.mesh import write_whole

RANK_BINS = 10


@dataclass(frozen=True)
class Verdict:
    """Calibration of one parameter.

    Args:
        count: simulations.
        coverage: share of central 90 % intervals that hold the truth.
        tolerance: two standard deviations of that share.
        p_value: of the chi-square test that the truth's places are uniform.
    """

    count: int
    coverage: float
    tolerance: float
    p_value: float


def verdicts(rows: Sequence[Row], bins: int = RANK_BINS) -> dict[str, Verdict]:
    """Coverage and uniformity of the truth's place, for each parameter."""
    return {name: _verdict(np.array([row.below[name] for row in rows]), bins) for name in rows[0].below}


def _verdict(places: FloatArray, bins: int) -> Verdict:
    from scipy.stats import chi2

    covered = float(np.mean((places >= 0.05) & (places <= 0.95)))
    counts = np.histogram(places, bins, (0.0, 1.0))[0]
    statistic = float(((counts - len(places) / bins) ** 2).sum() / (len(places) / bins))
    tolerance = 2.0 * float(np.sqrt(0.9 * 0.1 / len(places)))
    return Verdict(len(places), covered, tolerance, float(chi2.sf(statistic, bins - 1)))


def by_kind(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each shape, in the order of CALIBRATED_KINDS."""
    groups = {kind: [row for row in rows if row.case.kind == kind] for kind in CALIBRATED_KINDS}
    return {kind: group for kind, group in groups.items() if group}


def write_record(rows: Sequence[Row], path: Path) -> Path:
    """A campaign as JSON: every verdict, over all noises and for each."""
    record = {
        "simulations": len(rows),
        "emcee": sum(row.case.method == "emcee" for row in rows),
        "fell back on emcee": sum(row.case.method != "emcee" and row.status != "not needed" for row in rows),
        "shapes": {kind: _by_noise(group) for kind, group in by_kind(rows).items()},
    }
    return write_whole(path, json.dumps(record, indent=1) + "\n")


def _by_noise(rows: Sequence[Row]) -> dict[str, dict[str, dict[str, float]]]:
    groups = {"all": list(rows)} | {
        noise: [row for row in rows if row.case.noise == noise] for noise in CALIBRATED_NOISES
    }
    return {
        noise: {name: {k: round(v, 4) for k, v in asdict(verdict).items()} for name, verdict in verdicts(group).items()}
        for noise, group in groups.items()
        if group
    }


def draw_ranks(rows: Sequence[Row], path: Path) -> Path:
    """Histograms of the truth's place in its posterior: a row for each shape, a panel for each parameter, as PNG.

    The grey band holds 99 % of the counts of a calibrated posterior (binomial).
    """
    from matplotlib.figure import Figure
    from scipy.stats import binom

    groups = by_kind(rows)
    columns = max(len(group[0].below) for group in groups.values())
    figure = Figure(figsize=(1.55 * columns, 1.5 * len(groups)), layout="constrained")
    axes = figure.subplots(len(groups), columns, sharex=True, squeeze=False)
    for line, (kind, group) in zip(axes, groups.items(), strict=True):
        verdict = verdicts(group)
        low, high = (float(binom.ppf(q, len(group), 1.0 / RANK_BINS)) for q in (0.005, 0.995))
        for panel, name in zip(line, verdict, strict=False):
            panel.axhspan(low, high, color="0.9")
            panel.hist([row.below[name] for row in group], RANK_BINS, (0.0, 1.0), color="#33658a")
            panel.set_title(f"{name}: {100 * verdict[name].coverage:.1f} %", fontsize=7)
            panel.tick_params(labelsize=6)
            panel.set_ylim(0.0, 2.2 * len(group) / RANK_BINS)
        line[0].set_ylabel(f"{kind}\n{len(group)} runs", fontsize=7)
        for panel in line[len(verdict) :]:
            panel.set_visible(False)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return write_whole(path, stream.getvalue())
