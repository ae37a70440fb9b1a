"""explore3d emulate, calibrate, selftest, reprobe: hardware, emulated and real."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from explore3d import UserError, count_text, seconds_text
from explore3d.cli.options import FilesFrom, Json, length, point
from explore3d.cli.run import SceneFile

Arm = Annotated[bool, typer.Option("--arm", help="Let a real machine move.")]
Radius = Annotated[str, typer.Option("--radius", help='Radius of the reference sphere, "12.5 mm".')]
Center = Annotated[str, typer.Option(metavar="X,Y,Z", help='Its centre in the object frame: "0 mm, 0 mm, 0 mm".')]


def emulate(
    device: Annotated[str, typer.Argument(help="What to emulate: grbl.")],
    mesh: Annotated[Path, typer.Option(help="Mesh of the body that the tip touches.")],
    units: Annotated[str, typer.Option(help="Unit of the mesh's coordinates.")] = "m",
    tip_radius: Annotated[str, typer.Option(help="Radius of the tip.")] = "10 mm",
    origin: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Machine coordinates of the object's origin; else those that init writes."),
    ] = None,
    sensor: Annotated[str | None, typer.Option(help="Force sensor at the tip: optoforce or line.")] = None,
    stiffness: Annotated[float, typer.Option(help="Of the tip, N/m.")] = 1e4,
    pace: Annotated[float, typer.Option(help="Emulated seconds per second.")] = 1.0,
    locked: Annotated[bool, typer.Option(help="Begin locked, as a machine just switched on.")] = False,
    folder: Annotated[Path, typer.Option(help="Where the ports appear, as links.")] = Path("/tmp/explore3d"),
    seconds: Annotated[float, typer.Option(help="Stop after so long; 0: when interrupted.")] = 0.0,
    json: Json = False,
) -> None:
    """Emulate a Grbl machine with a round tip on a pseudo-terminal, until interrupted.

    `explore3d init tile --example grbl_peck` writes a mesh that fits into its travel.

    Example: explore3d emulate grbl --mesh tile/wire_on_tile.ply --tip-radius "5 mm" --sensor optoforce
    """
    import time
    from contextlib import suppress
    from json import dumps

    from explore3d.jobs.machines import Emulation, serve
    from explore3d.scene import MIDDLE_OF_TRAVEL

    if device != "grbl" or sensor not in (None, "optoforce", "line"):
        raise UserError(f"cannot emulate {device!r} with sensor {sensor!r}; possible: grbl, optoforce or line sensor")
    if not (stiffness > 0.0 and pace > 0.0):
        raise UserError(f"--stiffness and --pace: should be greater than 0; found {stiffness:g} and {pace:g}")
    emulation = Emulation(
        mesh=mesh,
        units=units,
        tip_radius=length("--tip-radius", tip_radius, positive=True),
        origin=point("--origin", ", ".join(MIDDLE_OF_TRAVEL) if origin is None else origin),
        sensor=sensor,
        stiffness=stiffness,
        pace=pace,
        locked=locked,
    )
    folder.mkdir(parents=True, exist_ok=True)
    with serve(emulation, folder) as server, suppress(KeyboardInterrupt):
        ports = dict(zip(("stage", "sensor"), map(str, server.ports), strict=False))
        print(dumps(ports) if json else "\n".join(f"{name}: {port}" for name, port in ports.items()), flush=True)
        until = time.monotonic() + seconds if seconds else float("inf")
        while time.monotonic() < until and server.error is None:
            time.sleep(0.1)


def calibrate(
    scene: SceneFile,
    radius: Radius,
    center: Center = "0 mm, 0 mm, 0 mm",
    out: Annotated[Path, typer.Option("--out", "-o", help="Tip profile to write.")] = Path("tip.toml"),
    lines: Annotated[int, typer.Option(help="Sweeps over the sphere.", min=2)] = 24,
    radius_sd: Annotated[str, typer.Option(help="Standard uncertainty of the sphere's radius.")] = "0 mm",
    arm: Arm = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the last recording beside --out.")] = False,
    json: Json = False,
    files_from: FilesFrom = None,
) -> None:
    """Find the tip's radius, its noise and the sensor's delay on a reference sphere; write a tip profile.

    Example: explore3d calibrate scene.toml --radius "12.5 mm" --out tip.toml --arm
    """
    from explore3d.jobs.machines import Recording, as_json, calibrate as find

    words = ["explore3d", "calibrate", str(scene), "--radius", radius, "--center", center, "--out", str(out)]
    words += ["--lines", str(lines), "--radius-sd", radius_sd, *["--arm"] * arm]
    folders = files_from or []
    words += [part for folder in folders for part in ("--files-from", str(folder))]
    sphere, doubt = length("--radius", radius, positive=True), length("--radius-sd", radius_sd)
    place = point("--center", center)
    with Recording(out, shlex.join(words), resume) as kept:
        profile = find(scene, sphere, place, lines=lines, radius_sd=doubt, arm=arm, recording=kept, files_from=folders)
        kept.write(profile)
    print(as_json(profile.record()) if json else "\n".join([*profile.lines(), f"profile: {out}"]))


def selftest(
    scene: SceneFile,
    radius: Radius,
    center: Center = "0 mm, 0 mm, 0 mm",
    arm: Arm = False,
    json: Json = False,
    files_from: FilesFrom = None,
) -> None:
    """Scan a reference sphere along four lines; print the range of radii with the time it took.

    Example: explore3d selftest scene.toml --radius "12.5 mm" --arm
    """
    from explore3d.jobs.machines import as_json, selftest as test
    from mapping import length_text

    sphere = length("--radius", radius, positive=True)
    found = test(scene, sphere, point("--center", center), arm=arm, files_from=files_from or ())
    contacts = count_text(int(found["samples"]), "contact")
    words = f"range of radii {length_text(found['range'])} in {seconds_text(found['time'])} ({contacts})"
    print(as_json(found) if json else words)


def reprobe(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of an earlier session.")],
    at: Annotated[str, typer.Option(metavar="X,Y,Z", help='A place on the body, object frame: "10 mm, 5 mm, 0 mm".')],
    touches: Annotated[int, typer.Option(help="How often to touch it.", min=1)] = 3,
    arm: Arm = False,
    json: Json = False,
    files_from: FilesFrom = None,
) -> None:
    """Touch one place of an earlier session again, and say how far off the record it is.

    Example: explore3d reprobe out/wire --at "12 mm, 3 mm, 0 mm"
    """
    from explore3d.jobs.machines import as_json, reprobe as touch

    found = touch(folder, point("--at", at), touches=touches, arm=arm, files_from=files_from or ())
    print(as_json(found.record()) if json else "\n".join(found.lines()))
