"""explore3d init, explore3d examples: something to begin with, in an empty folder."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from explore3d import UserError
from explore3d.cli.doctor import compile_kernels, must_compile
from explore3d.cli.options import Json
from explore3d.cli.run import run
from explore3d.scene import copy_example, example as find, examples as all_examples, programs

DEMO = "wire_on_plate"
COMPILING = (
    "compiling, once: an example is explored for it (a minute or two; after Ctrl-C the first runs do it instead)"
)


def init(
    folder: Annotated[
        Path, typer.Argument(metavar="[DIR]", help="Where scene.toml belongs; made if it is not there.")
    ] = Path("."),
    example: Annotated[
        str | None, typer.Option("--example", help="Begin from this example (see `explore3d examples`).")
    ] = None,
    mesh: Annotated[
        Path | None, typer.Option("--mesh", help="Global model of your object: GLB, OBJ, OFF, PLY or STL.")
    ] = None,
    units: Annotated[str | None, typer.Option("--units", help="Unit of length of that file, for example mm.")] = None,
    tip_radius: Annotated[str | None, typer.Option("--tip-radius", help='Of your spherical tip, "5 mm".')] = None,
    finger: Annotated[str, typer.Option("--finger", help="simulated or grbl.")] = "simulated",
    port: Annotated[str, typer.Option("--port", help="Serial port of a Grbl machine.")] = "emulator",
    json: Json = False,
) -> None:
    """Write a scene to begin from: an example with its meshes, or one for your own mesh, tip and finger.

    On a terminal, what is missing is asked for. The first time after an installation all is compiled, too, for a minute
    or two, so that the first run is as quick as the second.

    Example: explore3d init wire --example wire_on_plate
    """
    from json import dumps

    from explore3d.jobs import foretold_survey
    from explore3d.scene import FINGER_KINDS, begin_scene, load_mesh, load_scene, mesh_text
    from mapping.base import Base

    if finger not in FINGER_KINDS:
        raise UserError(f"--finger {finger!r}: there is no such finger; possible: {', '.join(FINGER_KINDS)}")
    if example is not None and mesh is not None:
        raise UserError("--example and --mesh: a scene begins from one of them; both are given")
    if example is None and mesh is None:
        answer = _asked(
            "Mesh of your object (empty: the example of a wire on a plate)", "--mesh FILE or --example NAME"
        )
        example, mesh = (None, Path(answer)) if answer else (DEMO, None)
    about = ""
    if example is not None:
        scene = copy_example(example, folder)[0]
    else:
        assert mesh is not None
        units = units or _asked(f"Unit of length in {mesh.name} (m, mm, in)", "--units")
        tip_radius = tip_radius or _asked("Radius of the spherical tip, with its unit (5 mm)", "--tip-radius")
        scene = begin_scene(folder, mesh, units, tip_radius, finger, port)
        surface = load_mesh(mesh, units)
        about = f"\nthe mesh: {mesh_text(surface)}"
        seconds, sentence = foretold_survey(begun := load_scene(scene), Base(surface))
        if seconds > begun.explore.time_budget:  # a wrong unit, most often
            about += f"\n{sentence}: is {units!r} its unit?"
    plan = shlex.join(["explore3d", "plan", str(scene)])
    explore = shlex.join(["explore3d", "run", str(scene), "--out", str(scene.parent / "out")])
    if must_compile():
        if not json:
            print(f"written: {scene}{about}\n{COMPILING}", file=sys.stderr, flush=True)
        compile_kernels(quiet=json)
    if json:
        print(dumps({"scene": str(scene), "plan": plan, "run": explore}))
        return
    print(f"written: {scene}{about}\nthe sweeps, before anything moves: {plan}\nexplore: {explore}")


def _asked(question: str, option: str) -> str:
    """What a person at the terminal answers; without one, the option is asked for."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UserError(f"init: {option} is missing, and there is no terminal to ask at")
    return str(typer.prompt(question, default="", show_default=False, err=True)).strip()


def examples(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Run this one; without, they are listed.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results of the one that is run.")
    ] = None,
    json: Json = False,
) -> None:
    """List the examples that come with the program, or run one.

    Example: explore3d examples wire_on_plate --out out/wire
    """
    from json import dumps

    if name is not None:
        chosen = find(name)
        run(chosen.scene, out or Path("out") / name, json=json)
        return
    known = all_examples().values()
    if json:
        print(dumps([{"name": each.name, "title": each.title, "scene": str(each.scene)} for each in known]))
        return
    for each in known:
        print(f"{each.name:<20}{each.title}")
    print("run one: explore3d examples NAME --out FOLDER; change one: explore3d init FOLDER --example NAME")
    folder = programs()
    if folder is not None:
        print(f"programs for a robot, a CNC probe, a stylus, a detector of your own: {folder}")
