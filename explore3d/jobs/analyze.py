"""analyze: recordings become the annotated model and its report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from explore3d import UserError, parse_length
from explore3d.analysis import Analysis, Progress, Stages, build_model, run_key, silent
from explore3d.jobs.conclude import conclude
from explore3d.jobs.objects import not_one_object
from explore3d.jobs.session import Job, Session
from explore3d.log import LOG, digest, large_log, load_logs, must_fit_analysis, read_base, sidecar_of
from explore3d.scene import load_mesh, read_tolerances, recorded_scene
from mapping import FormError, TraceError
from mapping.base import Base
from mapping.geometry.mesh import algebra_in_one_thread

# What `analyze` hands on to load_logs and to the readers
READING_SETTINGS = (
    "tip_sd", "form", "mask", "in_contact", "tolerances", "units", "columns", "frame", "jump", "reference", "decimal",
    "pixel", "average", "part",
)  # fmt: skip


@algebra_in_one_thread()
def analyze(
    logs: Sequence[Path | str] | Path | str,
    out: Path | str | None = None,
    *,
    tip_radius: str | float | None = None,
    model: Path | str | None = None,
    model_units: str = "m",
    progress: Progress = silent,
    force: Collection[str] = (),
    overwrite: bool = False,
    report: bool = True,
    quick: bool = False,
    cutoffs: tuple[float | None, float | None] = (None, None),
    **table: Any,
) -> Analysis:
    """Build the annotated model of what was recorded.

    Args:
        logs: MCAP logs, folders of sessions, or tables of positions; of one object and one fingertip.
        out: folder for model and report; None writes nothing.
        tip_radius: of a table: "2 um", or metres.
        model: mesh file of the global model; None takes the one in the log, else fits one.
        model_units: of that file.
        progress: told the stage and the share of it that is done.
        force: stages to run although the recording does not need them.
        overwrite: replace, once this one is complete, a session of another recording in that folder.
        report: False to write no report and no pictures.
        cutoffs: nesting indices of the L-filter and of the S-filter for roughness, m; None: by the standard.
        quick: only existence, places and sizes: no report, no chains, no estimated surface.
        table: tip_sd, form, mask, in_contact, tolerances (explore3d.log.load_logs); units, columns, frame, jump,
            reference, pixel of a table (explore3d.log.table.read_table); average: samples of a run that becomes one,
            their mean; part: which of several that a file holds.

    Raises:
        UserError: input that cannot be used, named by file and field.
        TypeError: what is no file's name, or a setting that there is not.
    """
    paths = [logs] if isinstance(logs, str | Path) else [*logs]
    _must_be_recordings(paths, table)
    told = Told(tip_radius, model, model_units, tuple(force), quick, table, cutoffs)
    if out is not None:
        words = ["explore3d", "analyze", *map(str, paths), "--out", str(out), *told.words()]
        words += [] if report or quick else ["--no-report"]
        job = Job("analyze", digest_of(paths), again=shlex.join(words))
        with results(paths, out, job, overwrite) as session:
            found = _analyze(paths, session, told, progress, report and not quick)
        return replace(found, folder=session.folder)
    return _analyze(paths, None, told, progress, False)


def _must_be_recordings(paths: Sequence[Any], table: Mapping[str, Any]) -> None:
    """Raises TypeError: one of them is no file's name, or a setting of their readers is none."""
    for path in paths:
        if not isinstance(path, str | Path):
            raise TypeError(
                f"a recording is the name of a file; found {type(path).__name__}; numpy.save writes an array to one"
            )
    for name in table:
        if name not in READING_SETTINGS:
            near = get_close_matches(name, READING_SETTINGS, n=1)
            hint = f" did you mean {near[0]!r}?" if near else ""
            raise TypeError(
                f"there is no setting {name!r} of a recording;{hint} possible: {', '.join(READING_SETTINGS)}"
            )


@dataclass(frozen=True)
class Told:
    """What an analysis is told that its recordings do not say; fields as the arguments of analyze."""

    tip_radius: str | float | None = None
    model: Path | str | None = None
    model_units: str = "m"
    force: tuple[str, ...] = ()
    quick: bool = False
    table: Mapping[str, Any] = field(default_factory=dict)
    cutoffs: tuple[float | None, float | None] = (None, None)

    @property
    def tolerances(self) -> Path | None:
        """The file that says what the drawing allows, None if none was given."""
        given = self.table.get("tolerances")
        return None if given is None else Path(given)

    def words(self) -> list[str]:
        """The options of a command that say the same."""
        words = [] if self.model is None else ["--model", str(self.model), "--model-units", self.model_units]
        words += table_words(self.tip_radius, dict(self.table))
        words += [part for name in self.force for part in ("--force", name)]
        return [*words, "--quick"] if self.quick else words

    def record(self, paths: Sequence[Path | str]) -> dict[str, Any]:
        """All that decides, beside the recordings' bytes, what comes of them: files by their digests.

        Raises:
            UserError: a sidecar, or the file of tolerances, that cannot be read.
        """
        sidecars = [sidecar_of(log_path(path)) for path in paths]
        return {
            "tip_radius": self.tip_radius,
            "model": None if self.model is None or not Path(self.model).is_file() else digest(self.model),
            "model_units": None if self.model is None else self.model_units,
            "force": sorted(self.force),
            "quick": self.quick,
            "cutoffs": [] if self.cutoffs == (None, None) else list(self.cutoffs),
            "sidecars": [digest(path) for path in sidecars if path is not None],
            **self.table,
            **({"tolerances": digest(allowed)} if (allowed := self.tolerances) is not None else {}),
        }


def analyze_each(
    logs: Sequence[Path | str],
    out: Path | str,
    *,
    same_object: bool = False,
    tell: Callable[[str], None] = lambda line: None,
    **settings: Any,
) -> list[Analysis]:
    """Analyse recordings as one object if that was said or their frames, extents and bases agree; else each alone.

    Args:
        logs: as for analyze.
        out: folder for the results; where each is analysed alone, for a folder of each one's name.
        same_object: they are sweeps over one object.
        tell: is told in a line which of both it was.
        settings: the others of analyze.

    Raises:
        UserError: as analyze.
    """
    paths = [Path(path) for path in logs]
    if len(paths) == 1 or same_object:
        return [analyze(paths, out, **settings)]
    options = ("model", "model_units", "progress", "force", "overwrite", "report", "quick", "cutoffs")
    read = {name: value for name, value in settings.items() if name not in options}
    why = not_one_object([load_logs([path], **read) for path in paths])
    if not why:
        tell(f"{len(paths)} files are taken as one object, for their tips, extents and bases agree")
        return [analyze(paths, out, **settings)]
    tell(f"analysed each on its own, for they may be of several objects: {why}; --same-object joins them")
    names = _names(paths)
    return [analyze([path], Path(out) / name, **settings) for path, name in zip(paths, names, strict=True)]


def _names(paths: Sequence[Path]) -> list[str]:
    """A folder's name for each recording, no two alike."""
    names: list[str] = []
    for path in paths:
        stem = path.resolve().parent.name if path.name == LOG else path.stem if path.is_file() else path.name
        count = sum(name == stem or name.rpartition("-")[0] == stem for name in names)
        names.append(f"{stem}-{count + 1}" if count else stem)
    return names


def results(paths: Sequence[Path | str], out: Path | str, job: Job, overwrite: bool) -> Session:
    """The session of what comes of recordings; one that lies in the folder itself stays there, with its scene."""
    own = [log_path(path) for path in paths if log_path(path).resolve().parent == Path(out).resolve()]
    return Session(out, job, keep=[*own, *([Path(out) / "scene.toml"] if own else [])], overwrite=overwrite)


def digest_of(paths: Sequence[Path | str]) -> str:
    """What makes two sets of recordings the same for a session: their bytes. Those that are missing count as empty."""
    files = [log_path(path) for path in paths]
    return "+".join(digest(file) if file.is_file() else "" for file in files)


def log_path(path: Path | str) -> Path:
    """The recording itself where the folder of a session is given."""
    return Path(path) / LOG if Path(path).is_dir() else Path(path)


def table_words(tip_radius: str | float | None, table: dict[str, Any]) -> list[str]:
    """The options of a command that say again how to read what does not say it."""
    words = [] if tip_radius is None else ["--tip-radius", str(tip_radius)]
    for name in ("units", "columns", "pixel", "part", "tip_sd", "form", "tolerances", "average"):
        words += [f"--{name.replace('_', '-')}", str(table[name])] if table.get(name) else []
    words += ["--in-contact"] if table.get("in_contact") else []
    words += [part for mask in table.get("mask") or () for part in ("--mask", mask)]
    origin = (table.get("frame") or {}).get("origin")
    return words if origin is None else [*words, "--frame", ", ".join(map(str, origin))]


def _analyze(
    paths: Sequence[Path | str], session: Session | None, told: Told, progress: Progress, report: bool
) -> Analysis:
    stages = Stages(progress, told.force, told.quick, told.cutoffs)
    if len(paths) == 1 and told.table.get("average") is None and (large := large_log(paths[0])) is not None:
        from explore3d.jobs.streaming import analyze_stream

        unused = [name for name in ("tip_sd", "form", "mask") if told.table.get(name) is not None]
        if unused:
            raise UserError(f"{large}: is too large to be loaded at once; {', '.join(unused)} cannot be set for it yet")
        given = None if told.model is None else Base(load_mesh(told.model, told.model_units))
        radius = None if told.tip_radius is None else parse_length(told.tip_radius)
        run = run_key(digest(large), told.record(paths))
        allowed = None if told.tolerances is None else read_tolerances(told.tolerances)
        return analyze_stream(
            large, session, stages, base=given, tip_radius=radius, tolerances=allowed, report=report, run=run
        )
    with stages.stage("reading"):
        log = load_logs(paths, tip_radius=told.tip_radius, **told.table)
        must_fit_analysis(", ".join(log.sources), len(log.trace))
        scene = recorded_scene(log.scene_text, log.sources[0]) if log.scene_text else None
        given = None if told.model is None else Base(load_mesh(told.model, told.model_units))
        base = given or read_base(log.events)
    try:
        if session is None:
            return build_model(log, scene, base, stages)
        run = run_key(log.sha256, told.record(paths))
        return conclude(session, log, scene, base, stages, report=report, run=run)
    except (TraceError, FormError) as error:  # too few samples, all in one place, no form for them: of which file
        raise UserError(f"{', '.join(log.sources)}: {error}") from error
