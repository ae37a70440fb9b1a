"""Kinds of fingers and force sensors: each has a table of its own, and makes its device; anybody's package may add one.

A package names its tables as entry points, in the groups `explore3d.fingers` and `explore3d.sensors`; ours stand in
FINGERS and SENSORS and are loaded the same way. The key `kind` chooses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import Field, ValidationError

from explore3d import SceneError
from explore3d.scene.complaint import complaint
from explore3d.scene.values import Delay, Extent, Length, Speed, Table, Turn
from hw import Finger, Move
from hw.sensors import ForceSensor
from mapping import FloatArray, Surface

FINGER_GROUP, SENSOR_GROUP = "explore3d.fingers", "explore3d.sensors"
FINGERS = {
    "simulated": "explore3d.scene.simulated:SimulatedFingerTable",
    "grbl": "explore3d.jobs.machines.machine_finger:GrblFingerTable",
    "given": "explore3d.scene.finger:GivenFingerTable",
}
SENSORS = {
    "optoforce": "explore3d.scene.machine:OptoForceTable",
    "line": "explore3d.scene.machine:LineSensorTable",
}
# Up to version 0.2 the resolved scene in a log held these defaults for every kind: there they say nothing
ONCE_WRITTEN = {"rate": 5000.0, "contact_data": False}
ONCE_WRITTEN_NOISE = {"angle": 0.0, "contact": 0.0}
ONCE_WRITTEN_SENSOR = {"baudrate": 115200, "counts_per_newton": [400.0, 400.0, 400.0]}

T = TypeVar("T", bound=Table)


@dataclass(frozen=True, eq=False)
class Setting:
    """What a finger is told of the scene that names it.

    Args:
        scene: the scene's file, for messages.
        tip_radius: m.
        seed: of what is random.
        armed: a real machine may move; without it the finger must refuse every move.
        model: the body where it stands, m, object frame, as far as it is known to more than a guess; else None.
        mesh: the surface (m) in a file of the scene, given its path and the name of its unit. Raises SceneError.
    """

    scene: Path
    tip_radius: float
    seed: int
    armed: bool
    model: Callable[[], Surface | None]
    mesh: Callable[[Path, str], Surface]


class FingerNoise(Table):
    """Noise of the centre (white, and correlated along the path): of a simulated finger, or of a data sheet.

    The analysis takes it for known to a share `doubt`.
    """

    white: Extent = 0.0
    correlated: Extent = 0.0
    correlation_length: Length = 1e-3
    doubt: Annotated[float, Field(gt=0)] = 0.1


class FingerTable(Table):
    """The table [finger] of one kind; a kind of its own adds its keys and makes its finger."""

    kind: str
    noise: FingerNoise = FingerNoise()

    def finger(self, setting: Setting) -> Finger:
        """The finger, not yet connected: entering it opens its ports. Raises SceneError, FingerError."""
        raise NotImplementedError(f"[finger] of kind {self.kind!r} makes no finger")

    @property
    def is_real(self) -> bool:
        """True if it moves something real: nothing of it moves without --arm."""
        return True

    @property
    def feels_normals(self) -> bool:
        """True if its traces hold contact normals, which the paper's algorithms 1 and 2 need."""
        return True

    @property
    def touched(self) -> tuple[Path, str] | None:
        """Mesh and unit of what it touches, where that is a file; the truth of a simulation."""
        return None

    def touches(self, move: Move, tip_radius: float) -> tuple[FloatArray, FloatArray] | None:
        """Where it touches along a sweep: the ball's commanded centres (N, 3), m, and unit directions in which it is
        pressed (N, 3); None: all along it."""
        return None

    def follows(self, tip_radius: float, smallest: float) -> tuple[float, float] | None:
        """Greatest speed at which it follows the smallest feature, m/s, and its samples per second; None: unknown."""
        return None


class GivenFingerTable(FingerTable):
    """A finger that a program hands in: run(scene, out, finger=...)."""

    kind: str = "given"

    def finger(self, setting: Setting) -> Finger:
        """There is none to make."""
        raise SceneError(
            f'{setting.scene}: finger.kind: "given" is a finger that a program hands in, by run(scene, out, '
            f"finger=...); possible here: {', '.join(sorted({*kinds(FINGER_GROUP)} - {'given'}))}"
        )


class SensorTable(Table):
    """The table [finger.sensor] of one kind; a kind of its own adds its keys and makes its sensor.

    Args:
        stiffness: of the tip and what carries it, N/m.
        period: of the control loop (s).
        approach_speed: m/s.
        delay: by how much the force is stamped later than the stage's position (s); see explore3d calibrate.
        turn: rotation vector that turns the sensor's axes into the machine's (rad).
    """

    kind: str
    stiffness: Annotated[float, Field(gt=0)] = 1e4
    period: Delay = 0.01
    approach_speed: Speed = 2e-3
    delay: Delay = 0.0
    turn: tuple[Turn, Turn, Turn] = (0.0, 0.0, 0.0)

    emulated: ClassVar[bool] = False

    def sensor(self, emulated_port: str | None) -> ForceSensor:
        """The sensor, not yet connected; on the port of its emulator, if there is one."""
        raise NotImplementedError(f"{type(self).__name__} makes no sensor")


@cache
def kinds(group: str) -> Mapping[str, EntryPoint]:
    """What can be asked for by name: ours, and what installed packages add; ours are not covered by theirs.

    Looked up once: it reads a file of every installed package, which took a third of the time to read a scene.
    """
    ours = {FINGER_GROUP: FINGERS, SENSOR_GROUP: SENSORS}[group]
    theirs = {point.name: point for point in entry_points(group=group)}
    return MappingProxyType(theirs | {name: EntryPoint(name, value, group) for name, value in ours.items()})


@cache
def _loaded(point: EntryPoint) -> type[Table]:
    wanted: type[Table] = FingerTable if point.group == FINGER_GROUP else SensorTable
    what = f"entry point {point.name} = {point.value} of {point.group}"
    try:
        table = point.load()
    except Exception as error:  # another's package may raise whatever it likes while it is imported
        raise SceneError(f"{what} cannot be loaded: {type(error).__name__}: {error}; mend that package") from error
    if not (isinstance(table, type) and issubclass(table, wanted)):
        raise SceneError(f"{what} is no subclass of {wanted.__name__} of explore3d.scene; found {table!r}")
    return table


def table_of(kind: str, group: str) -> type[Table]:
    """The class of a kind's table. Raises SceneError: no such kind, or its package cannot be loaded."""
    known = kinds(group)
    if kind not in known:
        raise SceneError(
            f"unknown kind {kind!r}; possible: {', '.join(sorted(known))}; others come with packages that have an "
            f"entry point in {group}"
        )
    return _loaded(known[kind])


def finger_table(tables: dict[str, Any]) -> FingerTable:
    """The table [finger], checked by the class of its kind. Raises SceneError, without the scene's name."""
    tables = {"kind": "simulated"} | tables
    made_of = _class(tables, FINGER_GROUP, "finger.kind")
    if tables["kind"] == "grbl":
        tables = _of_an_earlier_log(tables)
    _refuse_keys_of_other_kinds(tables, made_of)
    if isinstance(tables.get("sensor"), dict) and "sensor" in made_of.model_fields:
        sensor = {"kind": "optoforce"} | tables["sensor"]
        tables |= {"sensor": _checked(_class(sensor, SENSOR_GROUP, "finger.sensor.kind"), sensor, "finger.sensor")}
    table = _checked(made_of, tables, "finger")
    assert isinstance(table, FingerTable)
    return table


def _of_an_earlier_log(tables: dict[str, Any]) -> dict[str, Any]:
    """The tables of a machine without the defaults of other kinds that a log of an earlier version wrote."""

    def without(table: Any, defaults: dict[str, Any]) -> Any:
        if not isinstance(table, dict):
            return table
        return {key: value for key, value in table.items() if key not in defaults or value != defaults[key]}

    tables = without(tables, ONCE_WRITTEN)
    inner: dict[str, dict[str, Any]] = {"noise": dict(ONCE_WRITTEN_NOISE)}
    sensor = tables.get("sensor")
    if isinstance(sensor, dict):
        used = "baudrate" if sensor.get("kind") == "line" else "counts_per_newton"
        inner |= {"sensor": {key: value for key, value in ONCE_WRITTEN_SENSOR.items() if key != used}}
    return tables | {name: without(tables[name], defaults) for name, defaults in inner.items() if name in tables}


def _class(tables: dict[str, Any], group: str, key: str) -> type[Table]:
    if not isinstance(tables["kind"], str):
        raise SceneError(f"{key}: should be a text; found {tables['kind']!r}")
    try:
        return table_of(tables["kind"], group)
    except SceneError as error:
        raise SceneError(f"{key}: {error}") from error


def _refuse_keys_of_other_kinds(tables: dict[str, Any], made_of: type[Table]) -> None:
    """A key of another of our kinds is not misspelt: say whose it is."""
    for key in tables.keys() - made_of.model_fields.keys():
        whose = sorted(name for name in FINGERS if key in table_of(name, FINGER_GROUP).model_fields)
        if whose:
            raise SceneError(f"finger.{key}: is for the kind {' or '.join(whose)}; the kind is {tables['kind']}")


def _checked(made_of: type[T], tables: dict[str, Any], name: str) -> T:
    try:
        return made_of.model_validate(tables)
    except ValidationError as error:
        raise SceneError(complaint(error, made_of, name)) from error
