"""Surface account: which part of the surface was swept, refused, cannot be reached, or was not inspected."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from explore3d import count_text
from explore3d.analysis.inspected import MOST_SURFACE_CELLS, Inspected
from explore3d.log import Log
from explore3d.scene import Scene
from mapping import BoolArray, FloatArray, Trace, length_text
from mapping.base import Base, LaidTrace
from mapping.detection import face_samples
from mapping.geometry.mesh import faces_side
from planners import Survey
from planners.paths import Carrier, reachable, resampled

# More of the reachable surface than this not swept: said first, and the command's exit status is not 0
MOST_UNSWEPT = 0.05
# Share of the surface from which on it counts as all of it: it is printed in whole per cent
NEARLY_ALL = 0.995
# Places of the surface that are asked, at most about so many
MOST_ACCOUNT_PLACES = 60_000
# A sweep on the other side of a thin plate has not touched this one: opposite normals count as this many reaches apart
OPPOSITE_APART = 1.0
# Why a finger leaves the region
OUT_OF_REGION = "what is found is followed to its ends, and ways lead round the body"
# What lies no further outside of a region than so many tip radii was touched from inside: sweeps are pressed on its
# border, and a ball that rolls over an edge there touches beside it
REGION_BORDER = 0.1


@dataclass(frozen=True)
class SurfaceAccount:
    """What became of the surface that was to be inspected; the four shares sum to 1.

    Args:
        area: m^2.
        swept: share within `reach` of a place that a sweep touched.
        refused: share that is reachable, was not swept, and lies within `reach` of a sweep that was refused.
        unreachable: share that the ball with its stem cannot touch by any pose, and that was not swept.
        not_inspected: share of the rest.
        reach: distance from a sweep up to which the smallest feature asked for is seen, m.
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

    @classmethod
    def of_log(
        cls, log: Log, trace: Trace, base: Base, scene: Scene | None, inspected: Collection[int] | None = None
    ) -> SurfaceAccount | None:
        """The account of a run by its log, and by its trace over the base.

        None without a scene that says what to inspect, or without a surface.

        Args:
            inspected: numbers of the sweeps on which something would have been seen; None: all.
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
        touched = laid.touched(MOST_SURFACE_CELLS)
        seen, unseen = touched, 0.0
        if inspected is not None and not (kept := np.isin(laid.sweep, list(inspected))).all():
            none = (np.zeros((0, 3)), np.zeros((0, 3)))
            seen = laid.within(kept).touched(MOST_SURFACE_CELLS) if kept.any() else none
            unseen = sum(float(own.arclength[-1]) for own in laid.laid_sweeps if own.number not in inspected)
        ways = [np.asarray(d["path"]) for d in made if d["purpose"] != "sweep"]
        return cls(
            **_shares(base, scene, seen, paths),
            unseen_path=unseen,
            **_beyond(scene, touched[0], ways),
            swept_path=lengths["sweep"],
            other_path=lengths["other"],
            refused_path=sum(_length(d) for d in refused if d.get("purpose") == "sweep"),
            moves=len(made),
            causes=_causes([str(d["what"]) for d in refused]),
            shortest_ridge=scene.survey.shortest_ridge,
            is_plan=False,
        )

    @classmethod
    def of_plan(
        cls, moves: Sequence[Any], refused: Sequence[tuple[Any, str]], base: Base, scene: Scene
    ) -> SurfaceAccount | None:
        """The account of planned moves, as if every sweep touched the bare body.

        Args:
            moves: hw.Move, those that break no limit.
            refused: those that do, and why.
        """
        if base.kind == "profile":
            return None
        sweeps = [move for move in moves if move.purpose == "sweep"]
        refusals = [move for move, _ in refused if move.purpose == "sweep"]
        spacing = 0.2 * scene.tip.radius
        dense = []
        for move in sweeps:
            touched = scene.finger.touches(move, scene.tip.radius) if len(move.path) > 1 else move.path
            dense.append(resampled(move.path, move.approach, spacing)[0] if touched is None else touched)
        feet = base.foot(np.concatenate(dense) if dense else np.zeros((0, 3)), scene.tip.radius)
        return cls(
            **_shares(base, scene, (feet.points, feet.normals), [move.path for move in refusals]),
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
        return self.shortest_ridge is None and self.unswept > MOST_UNSWEPT

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        names = ["area", "swept", "refused", "unreachable", "not_inspected", "reach"]
        names += ["swept_path", "other_path", "refused_path", "moves"]
        causes = [{"why": why, "moves": count} for why, count in self.causes]
        names += [] if self.touched_beyond is None else ["touched_beyond", "ways_beyond"]
        return {name: getattr(self, name) for name in names} | {"unswept": self.unswept, "causes": causes}

    def warning(self) -> str:
        """The first thing to say where too much is missing, else ""."""
        if not self.short:
            return ""
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
        if self.is_plan:
            is_swept, is_missed = "would be swept", "would not be inspected"
        sentence = (
            f"Of the surface {100 * self.swept:.1f} % {is_swept} ({length_text(self.swept_path)} of sweeps, which see "
            f"{length_text(self.reach, 2)} to either side), {100 * self.refused:.1f} % refused, "
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
    base: Base, scene: Scene, touched: tuple[FloatArray, FloatArray], refused: Sequence[FloatArray]
) -> dict[str, float]:
    """Area, reach, and the four shares."""
    tip = scene.tip.radius
    survey = Survey(base=base, tip_radius=tip, smallest=scene.survey.smallest_feature, **scene.model.asked)
    surface, reach = survey.surface, 0.55 * survey.pitch
    if surface is None:  # the body stands elsewhere than its mesh said
        nothing = {"swept": 0.0, "refused": 0.0, "unreachable": 0.0, "not_inspected": 1.0}
        return nothing | {"area": 0.0, "reach": reach}
    spacing = max(reach / 3.0, float(np.sqrt(surface.face_areas.sum() / MOST_ACCOUNT_PLACES)))
    points, owner = face_samples(surface, spacing)
    weights = surface.face_areas[owner] / np.bincount(owner, minlength=len(surface.faces))[owner]
    normals = surface.face_normals[owner]
    swept = _near(points, normals, *touched, reach)
    feet = base.foot(np.concatenate([*refused, np.zeros((0, 3))]), tip)
    tried = _near(points, normals, feet.points, feet.normals, reach)
    down = (
        faces_side(normals, np.array([[0.0, 0.0, -1.0]]))
        if scene.model.sides is None
        else np.zeros(len(points), dtype=bool)
    )
    can = np.ones(len(points), dtype=bool)
    rest = np.flatnonzero(~swept)
    can[rest] = reachable(points[rest], normals[rest], Carrier.of(base, tip))
    parts = {"below": down, "swept": swept, "refused": ~swept & can & tried, "unreachable": ~swept & ~can}
    total = max(float(weights.sum()), float(np.finfo(float).tiny))
    shares = {name: float(weights[mask].sum()) / total for name, mask in parts.items()}
    whole = shares["swept"] + shares["refused"] + shares["unreachable"]
    return shares | {
        "area": float(weights.sum()),
        "reach": reach,
        "not_inspected": max(0.0, 1.0 - whole),
    }


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


def _near(points: FloatArray, normals: FloatArray, touched: FloatArray, up: FloatArray, reach: float) -> BoolArray:
    """(N,) True where a touched place (M, 3) lies within reach, on the same side of the body."""
    from scipy.spatial import cKDTree

    if not len(touched):
        return np.zeros(len(points), dtype=bool)
    apart = 0.5 * OPPOSITE_APART * reach
    tree = cKDTree(np.column_stack([touched, apart * up]))
    distance, _ = tree.query(np.column_stack([points, apart * normals]), distance_upper_bound=reach)
    return np.isfinite(distance)


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
