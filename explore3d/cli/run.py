"""explore3d run, explore3d plan: exploring what a scene describes, or only planning it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from explore3d.cli.options import INCOMPLETE, FilesFrom, Force, Json, NoReport, Out, Overwrite

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE.toml", help="The scene to explore.")]


def run(
    scene: SceneFile,
    out: Out,
    force: Force = None,
    json: Json = False,
    arm: Annotated[
        bool, typer.Option("--arm", help="Let a real machine move; without it, its moves are only planned and checked.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a broken-off session in that folder stopped.")
    ] = False,
    overwrite: Overwrite = False,
    files_from: FilesFrom = None,
    no_report: NoReport = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Show in the browser what is felt; the view is a program of its own.")
    ] = False,
) -> None:
    """Explore the scene with its finger; write the log, the annotated model and the report.

    Example: explore3d run wire/scene.toml --out out/wire
    """
    from explore3d.jobs import open_scene

    if not arm and open_scene(scene, files_from or ()).finger.is_real:
        short = _planned(scene, out, json, overwrite, files_from)
        if not json:
            print("dry run: connected and checked, nothing was moved; add --arm to explore with the real machine")
        if short:
            raise typer.Exit(INCOMPLETE)
        return
    from explore3d.cli.progress import shown
    from explore3d.jobs import run as explore
    from explore3d.report import show

    view = None
    with shown(quiet=json) as progress:
        if watch:
            from explore3d.report.watch import ViewBeside

            progress = view = ViewBeside(out, progress)  # held until the run is over: its standard input ends then
        analysis = explore(
            scene,
            out,
            progress=progress,
            force=force or (),
            arm=arm,
            resume=resume,
            overwrite=overwrite,
            files_from=files_from or (),
            report=not no_report,
        )
    show(analysis, out, json)
    if view is not None and not json:
        print("the view stays as long as a browser looks at it" if view.is_there else "the view has ended")
    short = analysis.account is not None and analysis.account.short
    if short or analysis.refused or (analysis.stopped is not None and analysis.stopped.incomplete):
        raise typer.Exit(INCOMPLETE)


def plan(
    scene: SceneFile,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for a picture of the sweeps.")] = None,
    json: Json = False,
    overwrite: Overwrite = False,
    files_from: FilesFrom = None,
) -> None:
    """Show the planned sweeps, their length, time and limit violations; nothing is moved.

    Example: explore3d plan wire/scene.toml --out out/plan
    """
    if _planned(scene, out, json, overwrite, files_from):
        raise typer.Exit(INCOMPLETE)


def _planned(scene: Path, out: Path | None, json: bool, overwrite: bool, files_from: list[Path] | None) -> bool:
    """Show the plan; True if a run by it would leave so much unswept that it ends as incomplete."""
    from json import dumps
    from shlex import quote

    from explore3d.cli.progress import shown
    from explore3d.jobs import plan_into

    with shown(quiet=json) as progress:
        planned = plan_into(scene, out, overwrite, files_from or (), progress)
    if json:
        print(dumps(planned.record()))
    else:
        picture = [] if out is None else [f"picture: {out / 'plan.png'}"]
        print("\n".join([*planned.lines(), *picture, f"next: explore3d run {quote(str(scene))} --out FOLDER"]))
    return planned.short
