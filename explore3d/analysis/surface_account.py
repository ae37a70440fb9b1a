"""Surface account: which part of the surface was swept, refused, cannot be reached, or was not inspected."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from explore3d import count_text
from explore3d.analysis.inspected import TOUCHED_SPACING, Inspected, touched_places
from explore3d.log import Log
from explore3d.scene import Scene
from mapping import FloatArray, Trace, length_text
from mapping.base import Base, LaidTrace
from mapping.detection import FoundHeights, found_heights, lost_heights, narrowest_groove
from mapping.geometry.mesh import asked_part, faces_side
from planners import Survey
from planners.paths import Carrier, held_up, reachable, resampled

# More of the reachable surface than this not swept: said first, and the command's exit status is not 0
MOST_UNSWEPT = 0.05
# Share of the surface from which on it counts as all of it: it is printed in whole per cent
NEARLY_ALL = 0.995
# Where no noise is known, or it hides what was asked for, half a strip counts as swept, and a tenth of that more
STRIP_SHARE = 0.55
# Places of what was not swept that are asked why, at most about so many
MOST_ACCOUNT_PLACES = 60_000
# Why a finger leaves the region
OUT_OF_REGION = "what is found is followed to its ends, and ways lead round the body"
# What lies no further outside of a region than so many tip radii was touched from inside: sweeps are pressed on its
# border, and a ball that rolls over an edge there touches beside it
REGION_BORDER = 0.1
# A ball that rests on the body's border, or rolls off it, is no further from the base than its radius, and one on a
# fine feature than that and its height: one further off than its own diameter more touches what the base does not have
OFF_BASE = 2.0


@dataclass(frozen=True)
class SurfaceAccount:
    """What became of the surface that was to be inspected; the four shares sum to 1.

    Args:
        area: m^2.
        swept: share so near to a sweep that it shows the smallest feature asked for with 95 % probability.
        refused: share that is reachable, was not swept, and would have been by a sweep that was refused.
        unreachable: share that the ball with its stem cannot touch by any pose, and that was not swept.
        not_inspected: share of the rest.
        reach: distance from a sweep up to which the smallest feature asked for is seen on a plane, m; where no
            noise is known, or hides that from all sweeps, half a strip.
        hidden: height from which on features show on a sweep, m, if that is more than was asked for; else None.
        hidden_groove: width from which on grooves show, m, if a groove was asked for that noise hides; else None.
        swept_path, other_path: lengths of executed sweeps, and of other executed moves, m.
        refused_path: length of refused sweeps, m.
        moves: executed.
        causes: (why, how many moves were refused for it), the most frequent first.
        shortest_ridge: m, where only lines of that length were asked for: then most of a surface need not be swept.
        is_plan: True if nothing was moved yet.
        touched_beyond, ways_beyond: how far outside of the scene's region the ball touched, and went on its ways, m;
            None without a region.
        unseen_path: length of sweeps too short, or of too few samples, for anything to be seen on them, m: what only
            they touched was not swept.
        below: share of the area that faces down; 0 where the scene names the sides that are explored.
        unmodelled: least share of a body without a mesh that lies off the base that was found (`unmodelled_share`).
        base_kind: of that base.
    """

    area: float
    swept: float
    refused: float
    unreachable: float
    not_inspected: float
    reach: float
    swept_path: float
    other_path: float
    refused_path: float
    moves: int
    causes: tuple[tuple[str, int], ...]
    shortest_ridge: float | None = None
    is_plan: bool = False
    touched_beyond: float | None = None
    ways_beyond: float | None = None
    unseen_path: float = 0.0
    below: float = 0.0
    hidden: float | None = None
    hidden_groove: float | None = None
    unmodelled: float = 0.0
    base_kind: str = ""

    @classmethod
    def of_log(
        cls,
        log: Log,
        trace: Trace,
        base: Base,
        scene: Scene | None,
        inspected: Inspected,
        seen: Collection[int] | None = None,
    ) -> SurfaceAccount | None:
        """The account of a run by its log, and by its trace over the base.

        None without a scene that says what to inspect, or without a surface.

        Args:
            inspected: what those sweeps say about the places where nothing was found.
            seen: numbers of the sweeps on which something would have been seen; None: all.
        """
        if scene is None or base.kind == "profile":
            return None
        made = [e.data for e in log.events if e.kind == "move"]
        refused = [e.data for e in log.events if e.kind == "refused"]
        lengths = {
            name: sum(_length(d) for d in made if (d["purpose"] == "sweep") is (name == "sweep")) for name in _KINDS
        }
        paths = [np.asarray(d["path"]) for d in refused if d.get("purpose") == "sweep"]
        laid = LaidTrace.of(trace, base)
        unseen = [own for own in laid.laid_sweeps if seen is not None and own.number not in seen]
        ways = [np.asarray(d["path"]) for d in made if d["purpose"] != "sweep"]
        return cls(
            **_shares(base, scene, inspected.found, inspected.limit, paths),
            unseen_path=sum(float(own.arclength[-1]) for own in unseen),
            **_beyond(scene, touched_places(laid)[0], ways),
            swept_path=lengths["sweep"],
            other_path=lengths["other"],
            refused_path=sum(_length(d) for d in refused if d.get("purpose") == "sweep"),
            moves=len(made),
            causes=_causes([str(d["what"]) for d in refused]),
            shortest_ridge=scene.survey.shortest_ridge,
            is_plan=False,
            unmodelled=unmodelled_share(log.trace, base) if scene.model.mesh is None else 0.0,
            base_kind=base.kind,
        )

    @classmethod
    def of_plan(
        cls, moves: Sequence[Any], refused: Sequence[tuple[Any, str]], base: Base, scene: Scene
    ) -> SurfaceAccount | None:
        """The account of planned moves: what every ball pressed along a sweep touches of the bare body.

        That is not where it is commanded to: in folds and inner corners another part of the body holds it up.

        Args:
            moves: hw.Move, those that break no limit.
            refused: those that do, and why.
        """
        if base.kind == "profile":
            return None
        sweeps = [move for move in moves if move.purpose == "sweep"]
        refusals = [move for move, _ in refused if move.purpose == "sweep"]
        spacing = TOUCHED_SPACING * scene.tip.radius
        dense = [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for move in sweeps:
            at_once = (move.path, move.approach)
            touched = scene.finger.touches(move, scene.tip.radius) if len(move.path) > 1 else at_once
            dense.append(resampled(*at_once, spacing) if touched is None else touched)
        centers, pressed = (np.concatenate(parts) for parts in zip(*dense, strict=True))
        held = held_up(centers, pressed, base, scene.tip.radius)
        feet = base.foot(centers - held[:, None] * pressed, scene.tip.radius)
        part = asked_part(base.surface, **scene.model.asked)
        found = found_heights(part or base.surface, feet.points, feet.normals, scene.tip.radius)
        return cls(
            **_shares(base, scene, found, scene.expected_limit, [move.path for move in refusals]),
            **_beyond(scene, feet.points, [move.path for move in moves if move.purpose != "sweep"]),
            swept_path=sum(move.length for move in sweeps),
            other_path=sum(move.length for move in moves if move.purpose != "sweep"),
            refused_path=sum(move.length for move in refusals),
            moves=len(moves),
            causes=_causes([why for _, why in refused]),
            shortest_ridge=scene.survey.shortest_ridge,
            is_plan=True,
        )

    @property
    def unswept(self) -> float:
        """Share of the reachable surface that was not swept."""
        reachable_share = 1.0 - self.unreachable
        return (self.refused + self.not_inspected) / reachable_share if reachable_share > 0 else 0.0

    @property
    def short(self) -> bool:
        """True if so much is missing that the run did not do what it was asked for."""
        return (self.shortest_ridge is None and self.unswept > MOST_UNSWEPT) or self.unmodelled > MOST_UNSWEPT

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        names = ["area", "swept", "refused", "unreachable", "not_inspected", "reach"]
        names += ["swept_path", "other_path", "refused_path", "moves"]
        causes = [{"why": why, "moves": count} for why, count in self.causes]
        names += [] if self.touched_beyond is None else ["touched_beyond", "ways_beyond"]
        names += ["unmodelled"] if self.unmodelled else []
        return {name: getattr(self, name) for name in names} | {"unswept": self.unswept, "causes": causes}

    def warning(self) -> str:
        """The first thing to say where too much is missing, or where noise hides what was asked for, else ""."""
        if self.unmodelled > MOST_UNSWEPT:
            return (
                f"NOT INSPECTED: {100 * self.unmodelled:.0f} % of the body that was felt, or more, lies off the "
                f"{self.base_kind} that was found: its form there is not known, and nothing was looked for. Needed is "
                "a mesh, or a region without that part."
            )
        if not self.short:
            if self.hidden is None or self.shortest_ridge is not None:
                return ""
            grooves = f", or grooves narrower than {length_text(self.hidden_groove, 2)}," if self.hidden_groove else ""
            lower = f"sharp features lower than {length_text(self.hidden, 2)}{grooves}"
            return f"NOT INSPECTED: no sweep shows {lower} in its noise."
        why = f", most often because {self.causes[0][0]}" if self.causes else ""
        if self.unseen_path > self.refused_path:
            sweeps = f"{length_text(self.unseen_path, 2)} of sweeps"
            why = f": {sweeps} are too short, or have too few samples, to show anything"
        is_missed = "would not be swept" if self.is_plan else "was not swept"
        return f"NOT INSPECTED: {100 * self.unswept:.0f} % of the surface that the finger can reach {is_missed}{why}."

    def sentence(self) -> str:
        """The account in one or two sentences."""
        refused = sum(count for _, count in self.causes)
        is_swept, is_missed = "was swept", "was not inspected"
        shown = "show what was asked for up to" if self.hidden is None else "see"
        if self.is_plan:
            is_swept, is_missed = "would be swept", "would not be inspected"
        sentence = (
            f"Of the surface {100 * self.swept:.1f} % {is_swept} ({length_text(self.swept_path)} of sweeps, which "
            f"{shown} {length_text(self.reach, 2)} to either side), {100 * self.refused:.1f} % refused, "
            f"{100 * self.unreachable:.1f} % the finger cannot reach, {100 * self.not_inspected:.1f} % {is_missed}."
        )
        if self.shortest_ridge is not None:
            sentence += f" Only lines of {length_text(self.shortest_ridge, 2)} or longer were asked for."
        if refused:
            told = "; ".join(f"{why} ({count})" for why, count in self.causes[:3])
            sentence += f" {count_text(refused, 'move')} refused of {refused + self.moves}: {told}."
        if self.is_plan and self.below > 0.0:
            sentence += f" It includes the underside, {100 * self.below:.0f} % of it; sides in [model] leaves that out."
        return sentence + self._outside()

    def _outside(self) -> str:
        """How far the finger leaves the region, and why; "" without one."""
        if self.touched_beyond is None or self.ways_beyond is None:
            return ""
        touched, ways = (length_text(far, 2) for far in (self.touched_beyond, self.ways_beyond))
        if self.is_plan:
            sweeps = (
                f"Sweeps leave the region by up to {touched}" if self.touched_beyond else "Sweeps stay in the region"
            )
            between = f", ways between them leave it by up to {ways}" if self.ways_beyond else ""
            return f" {sweeps}{between}; what is found is followed to its ends, out of it, too."
        if not self.touched_beyond and not self.ways_beyond:
            return " The finger stayed in the region."
        felt = f"touched up to {touched}" if self.touched_beyond else "touched nothing"
        between = f", and went up to {ways}" if self.ways_beyond else ""
        return f" Outside of the region the finger {felt}{between}: {OUT_OF_REGION}."


_KINDS = ("sweep", "other")


def _shares(
    base: Base, scene: Scene, found: FoundHeights, limit: float | None, refused: Sequence[FloatArray]
) -> dict[str, Any]:
    """Area, reach, the four shares, and what noise hides.

    Args:
        found: places of what was to be inspected, and what is lost at each.
        limit: height found where a sweep crosses it, m; None: not known.
    """
    tip, smallest = scene.tip.radius, scene.smallest
    survey = Survey(base=base, tip_radius=tip, smallest=smallest, **scene.model.asked)
    hidden = limit if limit is not None and smallest <= limit < np.inf else None
    if limit is None or limit >= smallest:
        reach = STRIP_SHARE * survey.pitch
    else:
        lost = min(smallest - limit, tip)
        reach = float(np.sqrt(lost * (2.0 * tip - lost)))
    most_lost = tip - np.sqrt((tip - reach) * (tip + reach))
    asked, hidden_groove = scene.survey.narrowest_groove, None
    if hidden is not None and asked is not None and asked < narrowest_groove(hidden, tip):
        hidden_groove = narrowest_groove(hidden, tip)
    told = {"reach": reach, "hidden": hidden, "hidden_groove": hidden_groove}
    if survey.surface is None:  # the body stands elsewhere than its mesh said
        nothing = {"swept": 0.0, "refused": 0.0, "unreachable": 0.0, "not_inspected": 1.0}
        return nothing | {"area": 0.0} | told
    swept = found.place <= most_lost
    rest = found.at(~swept)
    # of what was not swept every so many-th place tells why
    rest = rest.at(np.arange(len(rest.area)) % (1 + len(rest.area) // MOST_ACCOUNT_PLACES) == 0)
    can = reachable(rest.points, rest.normals, Carrier.of(base, tip))
    feet = base.foot(np.concatenate([*refused, np.zeros((0, 3))]), tip)
    tried = lost_heights(rest.points, rest.normals, feet.points, feet.normals, tip) <= most_lost
    area, least = float(found.area.sum()), float(np.finfo(float).tiny)
    missed = float(found.area[~swept].sum()) / max(area, least)
    refused_share, unreachable = (
        missed * float(rest.area[which].sum()) / max(float(rest.area.sum()), least) for which in (can & tried, ~can)
    )
    below = 0.0
    if scene.model.sides is None:
        down = faces_side(found.normals, np.array([[0.0, 0.0, -1.0]]))
        below = float(found.area[down].sum()) / max(area, least)
    return told | {
        "area": area,
        "swept": 1.0 - missed,
        "refused": refused_share,
        "unreachable": unreachable,
        "not_inspected": max(0.0, missed - refused_share - unreachable),
        "below": below,
    }


def unmodelled_share(trace: Trace, base: Base) -> float:
    """Least share of a felt body that lies off its base: of the boxes a tip's diameter wide in which the ball was.

    What lies on the base is swept again and again, and the rest crossed by the first lines alone: not all boxes of that
    are known, but none counts twice.

    Args:
        trace: all that was felt, also while the base was not known.
        base: as found.
    """
    tip = trace.tip_radius
    _, box = np.unique(np.floor(trace.centers / (2.0 * tip)), axis=0, return_inverse=True)
    off = base.nearest.query(trace.centers).distance > (1.0 + OFF_BASE) * tip
    if not len(off):
        return 0.0
    return float((np.bincount(box.ravel(), off) > 0.5 * np.bincount(box.ravel())).mean())


def _beyond(scene: Scene, touched: FloatArray, ways: Sequence[FloatArray]) -> dict[str, Any]:
    """How far outside of the region places (M, 3) were touched, and centres on ways (each (K, 3)) lay, m.

    A ball that touches the region's border lies no further outside of it than its own radius.
    """
    part, tip = scene.model.part, scene.tip.radius
    if part is None:
        return {"touched_beyond": None, "ways_beyond": None}

    def furthest(points: FloatArray, allowed: float) -> float:
        outside = np.maximum(np.maximum(part[0] - points, points - part[1]), 0.0)
        beyond = float(np.linalg.norm(outside, axis=1).max(initial=0.0)) - allowed
        return beyond if beyond > REGION_BORDER * tip else 0.0

    return {
        "touched_beyond": furthest(touched, 0.0),
        "ways_beyond": furthest(np.concatenate([*ways, np.zeros((0, 3))]), tip) if len(ways) else 0.0,
    }


def _length(data: dict[str, Any]) -> float:
    path = np.asarray(data.get("path", np.zeros((0, 3))), dtype=np.float64)
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) if len(path) > 1 else 0.0


def _causes(reasons: Sequence[str]) -> tuple[tuple[str, int], ...]:
    """Reasons that differ in their numbers alone are one; the first one's words stand for them."""
    first: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for reason in reasons:
        plain = reason.partition(": ")[2] or reason
        kind = re.sub(r"[-+]?[0-9.]+(e-?[0-9]+)?", "#", plain)
        first.setdefault(kind, plain)
        counts[kind] += 1
    return tuple((first[kind], count) for kind, count in counts.most_common())


def swept_share(inspected: Inspected | None, account: SurfaceAccount | None, base: Base) -> float:
    """Share of the surface that the sweeps came near; 1 if that is nearly all, or if there is but one profile.

    Args:
        inspected: which places are free of features; None if not asked.
        account: of a scene, which leaves out what no ball can reach; None without one.
        base: the global model.
    """
    if inspected is None or base.kind == "profile":
        return 1.0
    swept = 1.0 - (inspected.untouched if account is None else account.unswept)
    return 1.0 if swept > NEARLY_ALL else swept
