"""Reprobe: touch again where a session touched, to tell a detail from a mishap."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from explore3d import UserError, __version__, count_text
from explore3d.jobs import cause, open_scene, scene_finger
from explore3d.log import LOG, Log, LogWriter, read_log
from hw import Move
from mapping import BoolArray, FloatArray, ObjectModel, Trace, length_text
from mapping.instrument import Noise

# Samples this close to the place, in tip radii, were taken of it
SAME_PLACE_REACH = 5e-3
# Standard deviations within which an offset is noise: 95 of 100 of a normal distribution
NOISE_REACH = 1.96


@dataclass(frozen=True, eq=False)
class Reprobed:
    """One place, then and now; metres, object frame.

    Args:
        sample: number of the recorded sample whose line of approach passes nearest to the place asked for.
        neighbours: how many samples of that sweep lie within SAME_PLACE_REACH of it, itself included.
        recorded: (3,) mean of the ball's centres there then.
        approach: (3,) unit direction in which it was pressed.
        felt: (N, 3) centres now, one for each touch.
        log: file with the touches; `explore3d analyze` takes it beside the session's log.
        noise: of one sample, as the session's model states it; None without a model.
    """

    sample: int
    neighbours: int
    recorded: FloatArray
    approach: FloatArray
    felt: FloatArray
    log: Path
    noise: Noise | None = None

    @property
    def offsets(self) -> FloatArray:
        """(N,) how much further out of the body than then each touch was, m."""
        return np.asarray((self.felt - self.recorded) @ -self.approach)

    @property
    def offset_sd(self) -> float | None:
        """Standard deviation of the mean offset if nothing moved, m; None where the noise is not known.

        White noise averages over samples and touches, what is correlated along a path does not over one place.
        """
        if self.noise is None:
            return None
        white = self.noise.white**2 * (1.0 / self.neighbours + 1.0 / len(self.felt))
        return float(np.sqrt(white + 2.0 * self.noise.correlated_sd**2))

    def record(self) -> dict[str, object]:
        """JSON values, SI units."""
        return {
            "sample": self.sample,
            "neighbours": self.neighbours,
            "recorded": self.recorded.tolist(),
            "felt": self.felt.tolist(),
            "offset": float(self.offsets.mean()),
            "offset_sd": self.offset_sd,
            "offsets": self.offsets.tolist(),
            "log": str(self.log),
        }

    def lines(self) -> list[str]:
        """The same in words."""
        offsets = self.offsets
        spread = f"; the touches scatter by {length_text(float(offsets.std(ddof=1)), 2)}" if len(offsets) > 1 else ""
        middle = float(offsets.mean())
        off = f"{length_text(abs(middle), 3)} further {'out' if middle >= 0 else 'in'}"
        near = count_text(self.neighbours, "sample")
        where = ", ".join(f"{1e3 * value:.3f}" for value in self.recorded)
        return [
            f"recorded then: the ball's centre at ({where}) mm, by {near} about number {self.sample}",
            f"felt again {count_text(len(offsets), 'time')}: {off} on average{spread}",
            *self._verdict(middle),
            f"log: {self.log}",
        ]

    def _verdict(self, offset: float) -> list[str]:
        """Whether noise explains the offset, if that is known."""
        sd = self.offset_sd
        if not sd:
            return []
        told = f"the session's noise alone gives {length_text(sd, 2)} (standard deviation)"
        if abs(offset) <= NOISE_REACH * sd:
            return [f"no sign that it moved: {told}"]
        return [f"it differs by more than noise: {abs(offset) / sd:.1f} times what {told[4:]}"]


def reprobe(
    folder: Path | str,
    at: tuple[float, float, float],
    *,
    touches: int = 3,
    arm: bool = False,
    files_from: Collection[Path | str] = (),
) -> Reprobed:
    """Touch a place of an earlier session again, with that session's finger, as it was touched then.

    Args:
        folder: of the session.
        at: (3,) a point on the body or a ball's centre, m; the nearest recorded sample counts.
        touches: how often.
        arm: let a real machine move.
        files_from: folders that its scene may name files in, beside those near it and those that the session read.

    Raises:
        UserError: no session there, or nothing was recorded within two tip radii.
        FingerError: not armed, or nothing is met.
    """
    folder = Path(folder)
    if not (folder / LOG).is_file():
        raise UserError(f"{folder}: no {LOG} in it; give the folder of a session made by explore3d run")
    log = read_log(folder / LOG)
    sample = _nearest(log, np.asarray(at, dtype=np.float64))
    approach = _approach(log, sample)
    there = _neighbours(log.trace, sample, approach)
    center = log.trace.centers[there].mean(axis=0)
    scene = open_scene(folder / "scene.toml", files_from)
    path = _unused(folder)
    about = {"software": f"explore3d {__version__}", "reprobes": log.sha256, "sample": sample}
    felt = []
    with scene_finger(scene, arm) as finger:
        resolution = finger.info.get("resolution", 0.0)
        with LogWriter(path, tip_radius=scene.tip.radius, metadata=about, resolution=resolution) as writer:
            try:
                for _ in range(touches):
                    move = Move(center[None, :], approach, scene.sweep_speed, scene.survey.force)
                    trace = finger.execute(move)
                    writer.write(move, trace)
                    if len(trace):
                        felt.append(trace.centers.mean(axis=0))
            except BaseException as error:
                error.add_note(
                    f"stopped after {len(felt)} of {count_text(touches, 'touch', 'touches')}: {cause(error)}"
                )
                if felt:
                    error.add_note(f"kept: {path}, and {folder} as it was")
                raise
    if not felt:
        raise UserError(f"{folder}: nothing is met any more at {np.round(1e3 * center, 3).tolist()} mm")
    return Reprobed(sample, int(there.sum()), center, approach, np.array(felt), path, _noise(folder))


def _noise(folder: Path) -> Noise | None:
    """The noise that the session's model states, its correlated parts as one."""
    if not (folder / "model.json").is_file():
        return None
    stated = ObjectModel.load(folder).provenance.get("noise")
    if stated is None:
        return None
    correlated = [stated["correlated"], *(term["sd"] for term in stated.get("further", []))]
    return Noise(stated["white"], float(np.linalg.norm(correlated)), stated["length"])


def _nearest(log: Log, at: FloatArray) -> int:
    """The sample nearest to a point on the body, seen along its approach: noise in height must not choose."""
    away = np.linalg.norm(log.trace.centers - at, axis=1)
    nearest = int(away.argmin())
    if not away[nearest] <= 2.0 * log.trace.tip_radius:
        raise UserError(
            f"nothing was recorded near {np.round(1e3 * at, 3).tolist()} mm: the nearest of {len(away)} samples, at "
            f"{np.round(1e3 * log.trace.centers[nearest], 3).tolist()} mm, is {length_text(away[nearest])} away"
        )
    near = np.flatnonzero(away <= 2.0 * log.trace.tip_radius)
    return int(near[_beside(log.trace.centers[near] - at, _approach(log, nearest)).argmin()])


def _neighbours(trace: Trace, sample: int, approach: FloatArray) -> BoolArray:
    """(N,) True for the samples of that sweep within SAME_PLACE_REACH tip radii of its line of approach."""
    away = trace.centers - trace.centers[sample]
    close = (_beside(away, approach) <= SAME_PLACE_REACH * trace.tip_radius) & (
        np.abs(away @ approach) <= trace.tip_radius
    )
    return np.asarray(close & (trace.sweep == trace.sweep[sample]))


def _beside(away: FloatArray, approach: FloatArray) -> FloatArray:
    """(N,) distance from the line of approach of points (N, 3) relative to it."""
    return np.asarray(np.linalg.norm(away - (away @ approach)[:, None] * approach, axis=1))


def _approach(log: Log, sample: int) -> FloatArray:
    """(3,) direction in which the finger pressed when it took that sample. Raises UserError."""
    for event in log.events:
        if event.kind == "move" and 0 <= sample - event.data["first"] < event.data["samples"]:
            path, approach = np.array(event.data["path"]), np.array(event.data["approach"])
            near = np.linalg.norm(path - log.trace.centers[sample], axis=1).argmin()
            return np.asarray(approach[near])
    raise UserError(f"{', '.join(log.sources)}: does not say how sample {sample} was approached")


def _unused(folder: Path) -> Path:
    number = 1
    while (path := folder / f"reprobe-{number}.mcap").exists():
        number += 1
    return path
