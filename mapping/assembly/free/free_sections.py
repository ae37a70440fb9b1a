"""Free sections: details of a sweep so much wider than a crest under the ball that the trace is their surface.

No family is fitted to them: the trace over the base, monotone on both sides of its extreme, is the section. What the
ball changes is known in closed form. On a flank of slope tan(a) the trace stands off the body by r (1/cos a - 1), and
round the edge of a wall it rolls along a circle; the tangent of the trace, drawn on to the base, therefore meets it
r tan(a/2) beside the body's own edge in either case, exactly (theory section 5.4). At the bottom of a hollow the ball
may touch both flanks and not what is between: its depth is then only bounded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.assembly.free.outline import OF_WIDE_LINE, WIDER_THAN_CREST, of_all_scales, overlap, times_crest
from mapping.assembly.free.section import FLANK, Section, flanks
from mapping.assembly.free.sizes import SectionSizes, sizes_of_section
from mapping.base import SHORTEST_LEVEL, LaidSweep, LaidTrace, SweepHeights
from mapping.detection import Crossing, Detections, terraced
from mapping.inference import POOLED_SPLINES
from mapping.inference.kinds import kind_made_of
from mapping.instrument import Noise

# Bins are no finer than this share of the tip's radius: a wall between two of them is told to 0.1 / sqrt(12) = 0.03
# radii, a thirtieth of what the ball itself takes of a width there
FINEST = 0.1
# The base is what most of a sweep lies on: where several lie on one level, a detail of one of them is shorter than half
LONGEST_OF_A_ROW = 0.5


@dataclass(frozen=True, eq=False)
class FreeSection:
    """What one sweep shows of a wide detail, measured.

    Args:
        crossing: where its middle is and which way the sweep went there; the signed height as felt.
        sizes: along the sweep.
        piece: heights of the sweep about it, in the finest bins.
        log_odds: for it, on this sweep.
        times_crest: how many times as wide it was felt as a crest of no width across the sweep.
        inside: crossings that are parts of it.
        extent: of the trace along the sweep, between where the tangents of its flanks meet the base, m.
        half_extent: so far it is more than half as high, m.
        round_body: True if it is felt as far as where the body faces the other way, as no spot is.
    """

    crossing: Crossing
    sizes: SectionSizes
    piece: SweepHeights
    log_odds: float
    times_crest: float
    inside: tuple[Crossing, ...]
    extent: float
    half_extent: float
    round_body: bool

    @property
    def sign(self) -> float:
        """+1 of what stands up, -1 of what is hollow."""
        return float(np.sign(self.crossing.height))


def free_sections(detections: Detections, trace: LaidTrace) -> tuple[list[FreeSection], list[Crossing], list[Crossing]]:
    """The wide details on the sweeps over a base that was fitted to them; crossings on one of them; all that are not.

    What is fine on a flank or a floor is too far from the base for a family that stands on it.

    Args:
        detections: of the trace; what they did not notice is no detail, unless the base has levels: a short one may be
            a floor or a plateau.
        trace: laid on its base.

    Reference: theory section 5.4.
    """
    found, rest, upon = list[FreeSection](), list[Crossing](), list[Crossing]()
    by_sweep: dict[int, list[Crossing]] = {}
    for crossing in detections.crossings:
        by_sweep.setdefault(crossing.sweep, []).append(crossing)
    levelled = len(trace.base.levels) > 1  # nothing was noticed of what one of them is the floor or the plateau of
    # over a base with levels, what lies as high for long may be one of them
    share = SHORTEST_LEVEL if levelled else LONGEST_OF_A_ROW
    # what several sweeps feel is judged together once they are linked
    alone = len(trace.laid_sweeps) == 1
    least = WIDER_THAN_CREST if alone else OF_WIDE_LINE
    for sweep in trace.laid_sweeps:
        left = by_sweep.pop(sweep.number, [])
        if left or levelled:
            between = float(np.median(np.diff(sweep.arclength)))
            for over in sweep.heights(max(between, FINEST * trace.tip_radius)):
                own = of_all_scales(over, trace.tip_radius, share, least, alone=alone)
                above = _on_levels(over, trace, least, alone)
                above = [each for each in above if not any(overlap(each, other) for other in own)]
                for number, section in enumerate([*own, *above]):
                    inside = [c for c in left if _overlaps(section, c, sweep.trace.t)]
                    told = inside or (levelled and number < len(own))
                    measured = _measured(section, over, sweep, detections.noise, inside) if told else None
                    if measured is not None:
                        found.append(measured)
                        fine = [c for c in inside if _stands_off(section, c)]
                        upon += [c for c in fine if section.begin < _bin(section.piece, c) < section.end]
                        left = [c for c in left if c not in inside or (c in fine and c not in upon)]
        rest += left
    return found, upon, [*rest, *(c for own in by_sweep.values() for c in own)]


def without_wide(detections: Detections, trace: LaidTrace) -> Detections:
    """The detections less those that are parts of wide sections: whose sides say nothing of how a crest was felt."""
    if trace.base.kind == "mesh" or not detections.crossings:
        return detections
    return replace(detections, crossings=tuple(free_sections(detections, trace)[2]))


def free_spot(section: FreeSection, algorithm: int) -> Feature:
    """The bump or pit of which one sweep shows a section."""
    crossing, sizes = section.crossing, section.sizes
    kind = kind_made_of(crossing.kind, line=False).name
    round_it = (
        f"it is felt as far as where the body faces the other way, as no {kind} is: a line along the sweep may be"
    )
    misfit = round_it if section.round_body else None
    return Feature(
        kind=kind,
        axis=crossing.point[None],
        normals=crossing.normal[None],
        height=sizes.height_interval(section.sign),
        width=sizes.width_interval(),
        length=Interval(0.0, 0.0, 0.0),
        evidence=Support(crossing.snr, len(section.inside), (algorithm,), section.log_odds),
        curvature_feature=False,
        position_sd=crossing.position_sd,
        notes=(*sizes.notes, *(() if misfit is None else (misfit,))),
        details=Details(top=sizes.top, free_section=True, misfit=misfit),
    )


def _on_levels(piece: SweepHeights, trace: LaidTrace, least: float, alone: bool) -> list[Section]:
    """The sections of a piece over the levels that it runs on; none over a base of one level."""
    over = terraced(piece, trace.base, trace.tip_radius).profile
    if over is piece:
        return []
    share = LONGEST_OF_A_ROW if alone else SHORTEST_LEVEL
    return of_all_scales(over, trace.tip_radius, share, least, alone=alone)


def _measured(
    section: Section, over: SweepHeights, sweep: LaidSweep, noise: Noise, inside: list[Crossing]
) -> FreeSection | None:
    """A section of the heights `over` the base, with its sizes; None if its flanks tell none."""
    piece = section.piece
    noise = noise.scaled(white=max(piece.samples, 1.0) ** -0.5)  # of a bin's mean
    place = piece.s[section.begin : section.end + 1]
    snr = float(np.linalg.norm(noise.whiten(section.monotone, place)[0]))
    # as many degrees of freedom as splines that follow any form
    paid = POOLED_SPLINES * np.log1p(snr**2 / POOLED_SPLINES)
    log_odds = 0.5 * (snr**2 - paid) - np.log(piece.length / np.ptp(place))
    sizes = sizes_of_section(section, sweep.trace.tip_radius, noise)
    if sizes is None or not np.isfinite(log_odds):
        return None
    left, right = flanks(section, FLANK)
    around = sizes.middle + np.array([-0.5, 0.0, 0.5]) * sizes.width
    before, center, after = (np.array([np.interp(s, piece.s, one) for one in piece.centers.T]) for s in around)
    foot, way = sweep.base.foot(center[None], sweep.trace.tip_radius), after - before
    crossing = Crossing(
        sweep=sweep.number,
        t=float(np.interp(sizes.middle, piece.s, piece.t)),
        point=foot.points[0],
        normal=foot.normals[0],
        tangent=way / max(float(np.linalg.norm(way)), np.finfo(float).tiny),
        kind="convex" if section.sign > 0.0 else "concave",
        height=section.sign * sizes.height,
        height_sd=sizes.height_sd,
        position_sd=0.5 * float(np.hypot(sizes.width_sd, sizes.foot_doubt)),
        half_width=0.5 * sizes.width,
        trace_curvature=0.0,
        snr=snr,
        curvature_feature=False,
        start=int(piece.first[section.begin]),
        stop=int(piece.first[section.end + 1]),
    )
    return FreeSection(
        crossing,
        sizes,
        over,
        float(log_odds),
        times_crest(section, sweep.trace.tip_radius),
        tuple(inside),
        right.foot - left.foot,
        piece.spacing * int((section.monotone > 0.5 * section.monotone.max()).sum()),
        _reaches_round(section, foot.normals[0], sweep),
    )


def _reaches_round(section: Section, normal: FloatArray, sweep: LaidSweep) -> bool:
    """True of a section part of which lies where the base faces away from the normal (3,) in its middle."""
    base = sweep.base
    if (base.surface.face_normals @ normal >= 0.0).all():  # no height field does, whatever is felt on it
        return False
    places = section.piece.centers[section.begin : section.end + 1]
    return bool((base.foot(places, sweep.trace.tip_radius).normals @ normal < 0.0).any())


def _overlaps(section: Section, crossing: Crossing, t: FloatArray) -> bool:
    """True of a crossing whose disturbance, or the path beside that it was compared with, covers part of a section."""
    piece = section.piece
    if not piece.t[0] <= crossing.t <= piece.t[-1]:
        return False
    reach, bins = 2.0 * crossing.half_width / piece.spacing, np.arange(len(piece.t))
    at = begin = end = _bin(piece, crossing)
    if not crossing.is_step:  # what an edge was compared with are its two terraces, however far they reach
        last = min(max(crossing.stop - 1, crossing.start), len(t) - 1)
        begin, end = np.interp([t[crossing.start], t[last]], piece.t, bins)
    return bool(min(begin, at) - reach <= section.end and max(end, at) + reach >= section.begin)


def _bin(piece: SweepHeights, crossing: Crossing) -> float:
    """The place of a crossing among the bins of its piece."""
    return float(np.interp(crossing.t, piece.t, np.arange(len(piece.t))))


def _stands_off(section: Section, crossing: Crossing) -> bool:
    """True of what a section that is monotone on either side does not hold: a detail on its flank, floor or side."""
    piece = section.piece
    off = piece.height.copy()
    off[section.begin : section.end + 1] -= section.sign * section.monotone
    reach, at = max(1, int(crossing.half_width / piece.spacing)), int(_bin(piece, crossing))
    return bool(np.abs(off[max(at - reach, 0) : at + reach + 1]).max() > 0.5 * abs(crossing.height))
