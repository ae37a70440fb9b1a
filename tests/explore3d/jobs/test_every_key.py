"""Every key of the scene does something: changed, it changes what is built or concluded, or it says "informative"."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel, create_model
from pydantic.fields import FieldInfo

from explore3d.analysis.build_model import build_model
from explore3d.analysis.stages import Stages
from explore3d.errors import SceneError
from explore3d.jobs.expedition import explorer
from explore3d.jobs.machines.machine_finger import GrblFingerTable
from explore3d.jobs.run import scene_finger
from explore3d.log.own.record import Log
from explore3d.scene import scene as scene_file
from explore3d.scene.finger import FingerTable, SensorTable
from explore3d.scene.machine import LineSensorTable, OptoForceTable
from explore3d.scene.scene import Scene, parse_scene
from explore3d.scene.settings import AnalysisSettings
from explore3d.scene.simulated import SimulatedFingerTable
from explore3d.scene.to_toml import scene_text
from explore3d.scene.values import is_informative
from hw.errors import FingerError
from hw.finger import Workspace
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace

ASSETS = Path(__file__).resolve().parents[3] / "assets"
MESHES = ASSETS / "meshes"
PLAIN = 'schema = "explore3d/scene/1"\ntip.radius = "5 mm"\nsurvey.smallest_feature = "0.3 mm"\nsurvey.force = "1 N"\n'
BOX = 'model.region = { low = ["-28 mm", "-18 mm", "-8 mm"], high = ["28 mm", "18 mm", "8 mm"] }\n'
TILE = f'model.mesh = "{MESHES}/tile.ply"\n'
OBJECT = f'finger.object = "{MESHES}/wire_on_tile.ply"\n'
NOISE = 'finger.noise.white = "0.05 mm"\nfinger.noise.correlated = "0.01 mm"\nfinger.noise.angle = "1 deg"\n'
MACHINE = 'finger.kind = "grbl"\nfinger.machine.port = "{}"\n'
SLIDING = 'finger.machine.touch = "slide"\nfinger.sensor.kind = "{}"\nfinger.sensor.port = "/dev/two"\n'
REAL, EMULATED = MACHINE.format("/dev/one"), MACHINE.format("emulator")
# Scenes in which every key has something to act on
SCENES = {
    "on a mesh": f"{PLAIN}{BOX}{TILE}{OBJECT}{NOISE}finger.dynamics.mass = 0.1\n"
    '[[truth]]\nkind = "ridge"\naxis = [[0, 0, 0], [0.01, 0, 0]]\nheight = 0.00065\n'
    '[[tolerance]]\nkind = "ridge"\nsize = "height"\nlimit = 0.001\nleast = 0.0001\n',
    "out of its pose": f'{PLAIN}{TILE}model.pose = "estimate"\n{OBJECT}',
    "unknown": f"{PLAIN}{BOX}{OBJECT}",
    "pecked": f"{PLAIN}{TILE}{OBJECT}{EMULATED}",
    "pecked in earnest": f"{PLAIN}{TILE}{REAL}"
    "finger.machine.low = [-0.2, -0.2, -0.1]\nfinger.machine.high = [-0.1, -0.1, 0.0]\n",
    "slid over": f"{PLAIN}{TILE}{REAL}{SLIDING.format('optoforce')}",
    "slid over by another": f"{PLAIN}{TILE}{REAL}{SLIDING.format('line')}",
    "slid over in emulation": f"{PLAIN}{TILE}{OBJECT}{EMULATED}{SLIDING.format('optoforce')}",
}
# What chooses by its key `kind`, and the classes that can be chosen
KINDS = {FingerTable: (SimulatedFingerTable, GrblFingerTable), SensorTable: (OptoForceTable, LineSensorTable)}
# When a link last heard something: no setting
CLOCK = "heard"
Key = tuple[str, ...]


def keys(table: type[BaseModel], before: Key = ()) -> Iterator[tuple[Key, FieldInfo]]:
    """Every key of the schema, tables opened."""
    for name, info in table.model_fields.items():
        key = (*before, info.alias or name)
        inner = [c for c in (info.annotation, *get_args(info.annotation)) if isinstance(c, type)]
        tables = [c for c in inner if issubclass(c, BaseModel)]
        if tables:
            for each in KINDS.get(tables[0], tables[:1]):
                yield from keys(each, key)
        else:
            yield key, info


def choices(annotation: Any) -> tuple[Any, ...]:
    """What a Literal within an annotation allows."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return tuple(choice for inner in get_args(annotation) for choice in choices(inner))


def others(value: Any, info: FieldInfo) -> list[Any]:
    """Other values for a key, of its kind."""
    allowed = choices(info.annotation)
    if value is None:
        wanted = str(info.annotation)
        if "Path" in wanted:
            return [str(MESHES / "flat.ply")]
        return ([[choice] for choice in allowed] or [[-0.3, -0.3, -0.3]]) if "tuple" in wanted else [0.003]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float):
        return [a for a in allowed if a != value and not isinstance(a, str)] or [
            value + 1,
            value * 1.1 + 1e-4,
            value / 3,
        ]
    if isinstance(value, str):
        found = [choice for choice in allowed if choice != value]
        return found or [str(MESHES / "flat.ply"), "cm", f"{value}/other"]
    if allowed:
        return [[choice] for choice in allowed if [choice] != value]
    return [(1.1 * np.array(value) + 1e-4).tolist()]


def changed(tables: dict[str, Any], key: Key, value: Any) -> dict[str, Any]:
    """The tables with another value at a key."""
    first, *rest = key
    inner = tables[first]
    if not rest:
        return tables | {first: value}
    if isinstance(inner, list):
        return tables | {first: [changed(inner[0], tuple(rest), value), *inner[1:]]}
    return tables | {first: changed(inner, tuple(rest), value)}


def value_at(tables: Any, key: Key) -> Any:
    """The value at a key; KeyError where a scene has not got the table."""
    for name in key:
        tables = tables[0] if isinstance(tables, list) and tables else tables
        if not isinstance(tables, dict) or name not in tables:
            raise KeyError(name)
        tables = tables[name]
    return tables


def written(tables: Any) -> Any:
    """The tables without what is None: TOML has no word for it."""
    if isinstance(tables, dict):
        return {name: written(value) for name, value in tables.items() if value is not None}
    return [written(value) for value in tables] if isinstance(tables, list) else tables


def told(thing: Any) -> Any:
    """What an object was made of, in values that can be compared."""
    if isinstance(thing, np.ndarray):
        return thing.shape, thing.tobytes()
    if isinstance(thing, partial):
        return told(thing.keywords)
    if isinstance(thing, TemporaryDirectory):
        return "folder"
    if isinstance(thing, str | Path):
        return re.sub(r"explore3d-\w+", "emulated", str(thing))  # the emulator's ports lie in a new folder every time
    if dataclasses.is_dataclass(thing):
        return type(thing).__name__, [told(getattr(thing, f.name)) for f in dataclasses.fields(thing) if f.init]
    if isinstance(thing, dict):
        return [(told(name), told(value)) for name, value in thing.items()]
    if isinstance(thing, list | tuple):
        return [told(value) for value in thing]
    if isinstance(thing, bool | int | float | type(None)):
        return thing
    made_of = (
        {name: value for name, value in vars(thing).items() if name != CLOCK} if hasattr(thing, "__dict__") else {}
    )
    return type(thing).__name__, told(made_of)


def configured(scene: Scene) -> Any:
    """What the jobs build from a scene before anything moves."""
    machine = scene.finger if isinstance(scene.finger, GrblFingerTable) else None
    emulated = None
    if machine is not None and not machine.is_real:
        emulated = machine.emulation(scene.setting())
    space = Workspace(np.full(3, -1.0), np.ones(3), 0.125, 10.0)
    return told((scene_finger(scene), emulated, explorer(scene, space), AnalysisSettings.of(scene)))


@cache
def felt() -> Log:
    """One sweep over a plate that nothing lies on."""
    count = 200
    centers = np.column_stack([np.linspace(-5e-3, 5e-3, count), np.zeros(count), np.full(count, 5e-3)])
    centers[:, 2] += 1e-5 * np.random.default_rng(0).standard_normal(count)
    return Log(Trace(np.linspace(0.0, 1.0, count), centers, np.zeros(count, dtype=np.int64), 5e-3))


def concluded(scene: Scene) -> Any:
    """What the analysis of one sweep says."""
    corners = 6e-3 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    analysis = build_model(felt(), scene, Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]))), Stages())
    return told((analysis.title, analysis.truth, analysis.judgements))


@cache
def tables_of(text: str, schema: type[BaseModel]) -> dict[str, Any]:
    """What a scene says, in the words of the schema that reads it."""
    return parse_scene(text, "scene.toml", files_from=[MESHES]).model_dump(mode="json", by_alias=True)


@cache
def seen(text: str, schema: type[BaseModel], looks: Callable[[Scene], Any]) -> Any:
    """What is seen of a scene as it is, which all its keys are held against."""
    return looks(parse_scene(text, "scene.toml", files_from=[MESHES]))


def has_effect(key: Key, info: FieldInfo, looks: Callable[[Scene], Any]) -> bool:
    """True if some other value of a key changes what is seen of some scene.

    A choice whose every other value is refused beside the rest of the scene has an effect, too.
    """
    accepted, refused = 0, 0
    for text in SCENES.values():
        tables = tables_of(text, scene_file.Scene)
        try:
            value = value_at(tables, key)
        except KeyError:
            continue
        for other in others(value, info):
            try:
                after = looks(
                    parse_scene(scene_text(written(changed(tables, key, other))), "scene.toml", files_from=[MESHES])
                )
            except (SceneError, FingerError):
                refused += 1
                continue
            accepted += 1
            if after != seen(text, scene_file.Scene, looks):
                return True
    assert accepted or refused, f"{'.'.join(key)}: no scene of this test has the key; add one"
    assert accepted or choices(info.annotation), f"{'.'.join(key)}: this test has no other value for it; add one"
    return not accepted


def dead(root: type[BaseModel]) -> set[str]:
    """Keys that do nothing, and are not marked informative; and those that are, and do something."""
    wrong = set()
    for key, info in keys(root):
        if len(choices(info.annotation)) == 1 and get_origin(info.annotation) is Literal:
            continue  # there is nothing to choose
        acts = has_effect(key, info, configured) or has_effect(key, info, concluded)
        if acts == is_informative(info):
            wrong.add(".".join(key))
    return wrong


def test_every_key_of_the_scene_changes_something_or_says_that_it_informs() -> None:
    assert dead(Scene) == set()


@pytest.mark.parametrize("name", SCENES)
def test_two_readings_of_a_scene_configure_the_same(name: str) -> None:
    one, two = (configured(parse_scene(SCENES[name], "scene.toml", files_from=[MESHES])) for _ in range(2))
    assert one == two


def test_a_new_key_that_nothing_reads_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    table = create_model("Longer", __base__=scene_file.SurveyTable, colour=(float, 0.5))
    longer = create_model("LongerScene", __base__=Scene, survey=(table, ...))
    monkeypatch.setattr(scene_file, "Scene", longer)
    info = table.model_fields["colour"]
    assert ("survey", "colour") in [key for key, _ in keys(longer)]
    assert not has_effect(("survey", "colour"), info, configured)
    assert not has_effect(("survey", "colour"), info, concluded)
