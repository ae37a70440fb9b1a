"""explore3d display, vibrate: what was found, for the hand."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from explore3d import UnitError, UserError, parse_rate, parse_speed
from explore3d.cli.options import Json, length, point
from explore3d.report.watch import asked, over, when_input_ends

Model = Annotated[Path, typer.Argument(metavar="MODEL", help="Folder or model.json of an annotated model.")]
Exaggeration = Annotated[
    float, typer.Option(help="Make the features' heights and widths so many times larger, 1 to 100.")
]
BallRadius = Annotated[
    str | None,
    typer.Option("--tip-radius", help="Radius of the ball that touches it; else of the tip that explored it."),
]
Speed = Annotated[str, typer.Option(help="Speed of the crossing.")]


def display(
    model: Model,
    device: Annotated[str, typer.Option(help="simulated, or one of an installed package.")] = "simulated",
    log: Annotated[Path | None, typer.Option("--log", help="Record what is felt: an MCAP log for analyze.")] = None,
    tip_radius: BallRadius = None,
    stiffness: Annotated[float, typer.Option(help="Of the surface, N/m.")] = 500.0,
    friction: Annotated[float, typer.Option(help="Coefficient of friction of the surface.")] = 0.0,
    damping: Annotated[float, typer.Option(help="Virtual damping while it touches, N s/m.")] = 0.0,
    exaggeration: Exaggeration = 1.0,
    scale: Annotated[float, typer.Option(help="Millimetres on the model for each millimetre of the device.")] = 1.0,
    origin: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Place on the model where the device's origin is.")
    ] = "0 mm, 0 mm, 0 mm",
    rate: Annotated[str, typer.Option(help="Of the simulated device; a real one says its own.")] = "1 kHz",
    speed: Speed = "30 mm/s",
    seconds: Annotated[float | None, typer.Option(help="Stop after so long.")] = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Let the simulated device run as fast as it can, not by the clock.")
    ] = False,
    json: Json = False,
) -> None:
    """Feel a model with a force-feedback device, or let a simulated hand cross each of its features.

    The force is zero when the program ends, however it ends, and within 5 ms when the device falls silent.

    Example: explore3d display out/wire --log felt.mcap
    """
    import sys
    from json import dumps

    from explore3d.report.display import feel, live
    from hw.display import Rendering
    from mapping import ObjectModel

    _positive("--seconds", seconds)
    rendering = Rendering(
        stiffness=stiffness, friction=friction, damping=damping, scale=scale, origin=point("--origin", origin)
    )
    known = ObjectModel.load(model)
    look = None if json or not sys.stderr.isatty() else live(known)
    felt = feel(
        known,
        device,
        tip_radius=None if tip_radius is None else length("--tip-radius", tip_radius, positive=True),
        exaggeration=exaggeration,
        rendering=rendering,
        rate=_parsed("--rate", rate, parse_rate),
        speed=_speed(speed),
        seconds=seconds,
        paced=not fast,
        log=log,
        look=look,
    )
    if look is not None:
        print(file=sys.stderr)  # the live line ends
    print(dumps(felt.record(), allow_nan=False) if json else "\n".join(felt.lines()))
    if log is not None and not json:
        print(f"log: {log}")


def vibrate(
    model: Model,
    path: Annotated[
        str, typer.Option("--path", metavar="X,Y,Z; X,Y,Z", help="Places over the model that the fingertip crosses.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="File: .wav, .ahap (Apple) or .hjif (MPEG).")],
    speed: Speed = "30 mm/s",
    tip_radius: BallRadius = None,
    exaggeration: Exaggeration = 1.0,
    full_scale: Annotated[
        str | None, typer.Option(help="Height that full scale stands for, of the actuator; else the crossing's own.")
    ] = None,
    json: Json = False,
) -> None:
    """Write what a fingertip that crosses a model feels as a vibration, and say how it stands to people's thresholds.

    Example: explore3d vibrate out/wire --path "0 mm, -15 mm, -10 mm; 0 mm, 15 mm, 10 mm" --out wire.wav
    """
    from json import dumps

    import numpy as np

    from explore3d.report.display import haptic_file, vibration
    from mapping import ObjectModel

    places = np.array([point("--path", each) for each in path.split(";")])
    found = vibration(
        ObjectModel.load(model),
        places,
        _speed(speed),
        tip_radius=None if tip_radius is None else length("--tip-radius", tip_radius, positive=True),
        exaggeration=exaggeration,
    )
    scale = None if full_scale is None else length("--full-scale", full_scale, positive=True)
    haptic_file(found, out, scale)
    low, high = found.band()
    record = {
        "file": str(out),
        "seconds": found.duration,
        "amplitude": found.amplitude,
        "band": [low, high],
        "events": found.events.tolist(),
        "times_threshold": found.above_threshold(),
    }
    print(dumps(record, allow_nan=False) if json else "\n".join([*found.lines(), f"vibration: {out}"]))


def watch(
    place: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of a session, or a log.")],
    live: Annotated[
        bool, typer.Option("--live", help="The run that is under way in that folder, or is about to begin there.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to serve on; the next free one if taken.")] = 8080,
    host: Annotated[
        str, typer.Option(help="Address to serve on; 0.0.0.0 lets the whole network look (there is no password).")
    ] = "127.0.0.1",
    attached: Annotated[bool, typer.Option("--attached", hidden=True)] = False,
    json: Json = False,
) -> None:
    """Look at a session in the browser, finished or while it grows: scrub through time, click a feature.

    Example: explore3d watch out/wire
    """
    if attached:
        _watch_beside(place, port)
        return
    from json import dumps

    from explore3d.report.watch import Watch, watch as serve

    def tell(view: Watch) -> None:
        names = [] if view.model is None else [each.id for each in view.model]
        record = {"url": view.url, "samples": view.stage.count, "features": names}
        print(dumps(record) if json else f"watch: {view.url} (Ctrl-C ends it)", flush=True)

    serve(place, live=live, port=port, host=host, told=tell)


def _watch_beside(place: Path, port: int) -> None:
    """The view that a run began: the viewer is loaded once a browser asks."""

    def tell(url: str) -> None:
        print(f"watch: {url}", flush=True)

    begun, ended = time.time_ns(), when_input_ends()
    found = asked(port, tell, over(ended))
    if found is not None:
        from explore3d.report.watch import watch_beside

        watch_beside(place, found, begun, ended, tell)


def _speed(text: str) -> float:
    return _parsed("--speed", text, parse_speed)


def _parsed(option: str, text: str, parse: Callable[[str], float]) -> float:
    try:
        value = parse(text)
    except UnitError as error:
        raise UserError(f"{option}: {error}") from error
    if not value > 0.0:
        raise UserError(f"{option}: should be greater than 0; found {text!r}")
    return value


def _positive(option: str, value: float | None) -> None:
    if value is not None and not value > 0.0:
        raise UserError(f"{option}: should be greater than 0; found {value:g}")
