"""Dry run: what the finger would do if nothing stood out anywhere; nothing is moved."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import count_text, seconds_text
from explore3d.analysis import Progress, Stages, SurfaceAccount, silent
from explore3d.jobs.expedition import Explorer, explorer, foretold_survey
from explore3d.jobs.run import open_scene, scene_digest, scene_finger
from explore3d.jobs.session import Job, Session
from explore3d.pictures import plan_picture
from explore3d.report import groove_sentence
from explore3d.scene import Scene, mesh_text
from hw import Finger, Move
from hw.probing import GrblFinger
from hw.simulated import SimulatedFinger
from mapping import Surface, Trace, length_text
from mapping.base import Base
from mapping.detection import face_samples, narrowest_groove
from mapping.geometry.mesh import algebra_in_one_thread
from planners import Spent, drive, dry_run
from planners.explore import Discover, SurveyCount

# What is rehearsed: how high, in heights of the smallest feature asked for, of which some are lower and some higher (a
# height from once to three times that changes a ridge's time by a fifth to either side); how long a ridge is at least,
# in tip radii; how wide a bump is, in heights; and the ridge's direction, rad, in line with no sweep
REHEARSED_HEIGHT, REHEARSED_LENGTH, REHEARSED_WIDTH, REHEARSED_TURN = 2.0, 5.0, 3.0, 0.6
# Room about a rehearsed detail, in tip radii: circuits and slides reach less than one beyond it
REHEARSED_ROOM = 3.0
# Moves that break a limit and are told one by one: on a body with a fold there are hundreds, for a few reasons
MOST_LISTED_MOVES = 10
# Places of a surface between which the mean way is asked
WAY_PLACES = 300


@dataclass(frozen=True)
class DetailTime:
    """Finger time that each detail adds to the survey, by rehearsal: the way to it, and all that is felt of it.

    Args:
        bump: of a bump, s; None where only ridges are asked for.
        ridge: of a ridge so long, s.
        length: of that ridge, m.
        height: of both, m.
    """

    bump: float | None
    ridge: float
    length: float
    height: float

    def sentence(self) -> str:
        """It in words."""
        size = f"{length_text(self.height, 2)} high"
        bump = "" if self.bump is None else f"a bump {size} about {seconds_text(self.bump)}, "
        ridge = f"a ridge {size} and {length_text(self.length, 2)} long about {seconds_text(self.ridge)}"
        return f"what is found takes more time: {bump}{ridge}, each"


@dataclass(frozen=True, eq=False)
class DryRun:
    """The planned moves.

    Args:
        base: the global model.
        tip_radius: m.
        moves: in their order.
        metres, seconds: finger path and time, the ways between the sweeps included.
        speed: of the sweeps, m/s.
        violations: (number of the move, what limit it breaks).
        account: what of the surface the sweeps would sweep; None if the time budget ends before the survey.
        assumed: what had to be assumed of the object; a sentence or "".
        pecking: s that the moves will take by the finger's own forecast, where it touches point by point; else None.
        detail: what each detail that is found adds; None where that cannot be rehearsed.
        mesh: size, faces and borders of the global model's mesh in words, "" without one.
        limit: height of a sharp crest that a sweep will show with 95 % probability, m; None: the noise is not known.
        stopped: why the survey would not come to its end, and what to do; a sentence, "" if it does.
    """

    base: Base
    tip_radius: float
    moves: tuple[Move, ...]
    metres: float
    seconds: float
    speed: float
    violations: tuple[tuple[int, str], ...]
    account: SurfaceAccount | None = None
    assumed: str = ""
    pecking: float | None = None
    detail: DetailTime | None = None
    mesh: str = ""
    limit: float | None = None
    stopped: str = ""

    @property
    def short(self) -> bool:
        """True if a run by this plan would end as incomplete."""
        return bool(self.stopped) or (self.account is not None and self.account.short)

    def record(self) -> dict[str, Any]:
        """The plan in JSON values: SI units."""
        return {
            "stopped": self.stopped or None,
            "mesh": self.mesh,
            "sweeps": sum(move.purpose == "sweep" for move in self.moves),
            "moves": [{"purpose": move.purpose, "path": move.path.tolist()} for move in self.moves],
            "length": self.metres,
            "time": self.seconds,
            "pecking_time": self.pecking,
            "detail_time": None if self.detail is None else asdict(self.detail),
            "speed": self.speed,
            "detection_limit": self.limit,
            "narrowest_groove": self.narrowest_groove,
            "covered": None if self.account is None else self.account.swept,
            "reach": None if self.account is None else self.account.reach,
            "violations": [{"move": number, "what": what} for number, what in self.violations],
            "surface": None if self.account is None else self.account.record(),
        }

    @property
    def narrowest_groove(self) -> float | None:
        """Width from which on a sweep will show a groove so, m; None where the noise is not known, or hides it."""
        narrowest = np.inf if self.limit is None else narrowest_groove(self.limit, self.tip_radius)
        return narrowest if np.isfinite(narrowest) else None

    def lines(self) -> list[str]:
        """The plan in words."""
        sweeps = count_text(sum(move.purpose == "sweep" for move in self.moves), "sweep")
        if self.pecking is None:
            pace, time = f" at {1e3 * self.speed:.3g} mm/s", seconds_text(self.seconds)
        else:
            pace, time = "", f"pecking takes it about {seconds_text(self.pecking)}, ways included"
        first = f"{sweeps}{pace}, {length_text(self.metres)} of finger path, {time}"
        broken = [f"move {number}: {what}" for number, what in self.violations[:MOST_LISTED_MOVES]]
        if (more_broken := len(self.violations) - MOST_LISTED_MOVES) > 0:
            broken.append(f"and {count_text(more_broken, 'more such move')}; --json lists all")
        assumed = [self.assumed] if self.assumed else []
        account = [] if self.account is None else [self.account.sentence()]
        warning = [self.account.warning()] if self.account is not None and self.account.warning() else []
        more = [] if self.detail is None else [self.detail.sentence()]
        mesh = [f"the mesh: {self.mesh}"] if self.mesh else []
        before = [*([self.stopped] if self.stopped else []), *warning, *mesh, *assumed]
        shown = []
        if self.limit is not None:
            crest = (
                f"A sharp crest {length_text(self.limit, 2)} high or higher is seen with 95 % where a sweep crosses it."
            )
            shown = [f"{crest} {groove_sentence(self.limit, self.tip_radius)}"]
        return [*before, first, *more, *shown, *account, *(broken or ["no move breaks a limit"])]

    def picture(self) -> bytes:
        """PNG of the base with the planned sweeps on it."""
        return plan_picture(self.base, self.moves, self.tip_radius, [number - 1 for number, _ in self.violations])


@algebra_in_one_thread()
def plan_scene(path: Path | str, files_from: Collection[Path | str] = (), progress: Progress = silent) -> DryRun:
    """Plan the exploration of a scene, and check every move against the finger's limits.

    Args:
        path: the scene's file.
        files_from: folders that it may name files in, beside those near it.
        progress: told the stage and the share of it that is done.

    Raises:
        SceneError: a scene that cannot be used.
    """
    stages = Stages(progress)
    with stages.stage("setting up"):
        scene = open_scene(path, files_from)
    with scene_finger(scene) as finger:
        return _planned(scene, finger, stages)


def _planned(scene: Scene, finger: Finger, stages: Stages) -> DryRun:
    """The plan, while the finger is connected: it knows how long its link and its limits make a move."""
    with stages.stage("base"):
        planned = explorer(scene, finger.workspace)
        first, base, assumed = _to_know_the_base(planned)
    spent, budget = Spent(planned.workspace.max_speed), planned.time_budget
    for move in first:
        spent.count(move)
    moves, violations, limits = list(first), list[tuple[int, str]](), planned.limits(base)

    def check(move: Move, last: Move | None) -> str | None:
        """What the run would refuse is refused here too: it is neither charged nor counted as covered."""
        moves.append(move)
        what = limits.violation(move, last)
        violations.extend([(len(moves), what)] if what else [])
        return what

    def made(move: Move) -> Trace:
        spent.count(move)
        return planned.nothing

    surveyed, ended = False, ""
    if spent.seconds < budget:
        count = SurveyCount()
        exploring = planned.explore(base=base, time_budget=budget - spent.seconds).plan(count=count)
        exploring = planned.prepared(exploring, base, Spent(spent.travel_speed), np.inf)
        with stages.stage("sweeps and ways") as share:

            def carried(move: Move) -> Trace:
                if count.planned:
                    share(min(1.0, count.made / count.planned))
                return made(move)

            _, outcome = drive(exploring, carried, check=check, empty=planned.nothing)
        surveyed = outcome.value is not None and outcome.value.surveyed
        ended = outcome.detail if outcome.reason != "budget" else ""
    stopped = "" if surveyed else f"the survey would not come to its end: {ended or _too_short(scene, planned)}"
    broken = {number - 1: what for number, what in violations}
    sound = [move for number, move in enumerate(moves) if number not in broken]
    refused = [(moves[number], what) for number, what in broken.items()]
    with stages.stage("surface swept"):
        account = SurfaceAccount.of_plan(sound, refused, base, scene) if surveyed else None
    with stages.stage("rehearsal"):
        detail = _rehearsed(scene, planned, base, finger) if isinstance(finger, SimulatedFinger) else None
    return DryRun(
        base,
        scene.tip.radius,
        tuple(moves),
        spent.metres,
        spent.seconds,
        scene.sweep_speed,
        tuple(violations),
        account,
        assumed,
        sum(map(finger.forecast, moves)) if isinstance(finger, GrblFinger) and finger.peck is not None else None,
        detail,
        "" if planned.given is None else mesh_text(planned.given.surface),
        scene.expected_limit,
        stopped,
    )


def _too_short(scene: Scene, planned: Explorer) -> str:
    """That the time budget ends before the survey, and how much would do, as far as that is foretold."""
    if planned.given is None:
        why = f"the time budget of {seconds_text(scene.explore.time_budget)} ends before it"
    else:
        why = foretold_survey(scene, planned.given)[1]
    return f"{why}; raise explore.time_budget or survey.smallest_feature"


def _rehearsed(scene: Scene, planned: Explorer, base: Base, finger: SimulatedFinger) -> DetailTime | None:
    """What a detail adds: the same procedures feel one on a flat plate with the same finger, and none.

    None if the noise hides even these.
    """
    import trimesh
    from scipy.spatial.distance import pdist
    from trimesh.transformations import rotation_matrix

    tip, ridges_only = scene.tip.radius, scene.survey.shortest_ridge
    height = REHEARSED_HEIGHT * scene.smallest
    length = max(ridges_only or REHEARSED_LENGTH * tip, REHEARSED_WIDTH * height)
    # in heights, for vertices nearer than 10 nm are taken for one
    wire = trimesh.creation.capsule(height=length / height - 1.0, radius=0.5).apply_scale(height)
    wire.apply_translation([0.0, 0.0, 0.5 * height] - wire.bounds.mean(axis=0))
    wire.apply_transform(rotation_matrix(0.5 * np.pi, [0, 1, 0], [0, 0, 0.5 * height]))
    wire.apply_transform(rotation_matrix(REHEARSED_TURN, [0, 0, 1]))
    cap = trimesh.creation.icosphere(subdivisions=4)
    cap.apply_scale([0.5 * REHEARSED_WIDTH * height] * 2 + [height])
    half = 0.5 * length + REHEARSED_ROOM * tip
    plate = trimesh.Trimesh(
        half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]], process=False
    )
    known = Base(Surface(plate.vertices, plate.faces))

    def seconds(*details: trimesh.Trimesh) -> float:
        """Finger time for the plate with these on it, s; no number if they are not found."""
        whole = trimesh.util.concatenate([plate, *details])
        touch = replace(finger, object=Surface(whole.vertices, whole.faces), margin=REHEARSED_ROOM * tip)
        rehearsing = replace(planned, workspace=touch.workspace)
        plan = planned.explore(base=known, region=None, time_budget=np.inf).plan()
        outcome, spent = rehearsing.carry_out(plan, known, touch.execute)
        found = outcome.value
        shown = not details or (found is not None and bool(found.tracks or found.bumps))
        return spent if shown else float("nan")

    surface = planned.explore(base=base).survey.surface or base.surface
    places = face_samples(surface, float(np.sqrt(surface.face_areas.sum() / WAY_PLACES))).points
    less = seconds() - float(pdist(places).mean()) / planned.workspace.max_speed
    ridge, bump = seconds(wire) - less, None if ridges_only else seconds(cap) - less
    return DetailTime(bump, ridge, length, height) if np.isfinite([ridge, bump or 0.0]).all() else None


def _to_know_the_base(planned: Explorer) -> tuple[list[Move], Base, str]:
    """The moves before exploring, the base that they are taken to find, and what was assumed; a sentence or ""."""
    if planned.discover is not None:
        moves, base = imagined(planned.discover)
        return moves, base, "the body is not known: planned as if it were flat and lay in the middle of the region"
    assert planned.given is not None  # a scene gives a mesh or a region
    if planned.locate is None:
        return [], planned.given, ""
    locating = planned.prepared(planned.locate.plan(), planned.given, Spent(planned.workspace.max_speed), np.inf)
    return dry_run(locating, planned.nothing)[0], planned.given, ""


def imagined(discover: Discover) -> tuple[list[Move], Base]:
    """How the discovery of an unknown body would go if it were a flat one in the middle of the region; its base."""
    low, high = discover.low, discover.high
    axis = "xyz".index(discover.sides[0][1])
    first, second = ((axis + 1) % 3, (axis + 2) % 3)[:: 1 if discover.sides[0][0] == "+" else -1]
    corners = np.tile(0.5 * (low + high), (4, 1))
    corners[:, first] = np.array([low, high, high, low])[:, first]
    corners[:, second] = np.array([low, low, high, high])[:, second]
    body = Surface(corners, [[0, 1, 2], [0, 2, 3]])
    finger = SimulatedFinger(object=body, tip_radius=discover.tip_radius, rate=200.0, margin=float(np.ptp([low, high])))
    record, outcome = drive(replace(discover, sides=discover.sides[:1]).plan(), finger.execute)
    return [move for move, _ in record], outcome.value


def plan_into(
    path: Path | str,
    out: Path | None,
    overwrite: bool = False,
    files_from: Collection[Path | str] = (),
    progress: Progress = silent,
) -> DryRun:
    """Plan; with a folder, write plan.json and plan.png into it. Arguments as for plan_scene.

    Raises:
        SceneError: a scene that cannot be used.
        FolderError: the folder cannot be used; said before anything is planned.
    """
    if out is None:
        return plan_scene(path, files_from, progress)
    subject = scene_digest(open_scene(path, files_from))
    with Session(out, Job("plan", subject, ("plan",)), overwrite=overwrite) as session:
        plan = plan_scene(path, files_from, progress)
        session.write("plan.json", json.dumps(plan.record(), indent=1))
        session.write("plan.png", plan.picture())
    return plan
