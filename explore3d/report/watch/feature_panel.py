"""What a view says of the feature that was clicked: sizes, evidence, the profile across it, its posterior."""

from __future__ import annotations

import math
from collections.abc import Sequence

from explore3d import count_text
from explore3d.pictures import corner_picture, cross_section, section_picture
from mapping import Feature, Interval, Trace, length_text
from mapping.base import Base

SIZES = ("height", "width", "length")


def feature_panel(
    feature: Feature, base: Base, trace: Trace | None, others: Sequence[Feature] = ()
) -> tuple[str, list[bytes]]:
    """Words (Markdown) and pictures (SVG): the profile across the feature where there is a trace, and its posterior.

    Args:
        feature: one of a model.
        base: the model's.
        trace: what was recorded; None shows no profile.
        others: features of the same model.
    """
    lines = [f"### {feature.id}", "", "| | median | 90 % interval |", "|---|---|---|"]
    for name in SIZES:
        value: Interval = getattr(feature, name)
        if value.median:
            median, span = value.text()
            lines.append(f"| {name} | {median} | {span} |")
    lines += ["", *_evidence(feature)]
    lines += [f"* {note}" for note in feature.notes]
    pictures = []
    if trace is not None:
        section = cross_section(feature, trace, base, (), others=others)
        if section is None:
            lines.append("* no sweep crosses it near its middle: no profile")
        else:
            pictures.append(section_picture([section], [None]))
    corner = corner_picture(feature)
    if corner is not None:
        pictures.append(corner)
    return "\n".join(lines), pictures


def _evidence(feature: Feature) -> list[str]:
    """Why the feature is believed, a list in Markdown."""
    support, posterior = feature.evidence, feature.posterior
    finer = "finer than the fingertip" if feature.curvature_feature else "gentler than the fingertip"
    signal = f"* signal to noise {support.snr:.3g} over {count_text(support.crossings, 'crossing')}"
    if support.log_odds is not None and math.isfinite(support.log_odds):
        signal += f", log odds {support.log_odds:.3g}"
    lines = [signal, f"* {finer}; axis known to {length_text(feature.position_sd, 2)} across"]
    if posterior is not None:
        why = f": {posterior.reason}" if posterior.reason else ""
        lines.append(f"* posterior of {len(posterior.samples)} draws, {posterior.status}{why}")
    return lines
