"""Scene: one TOML file that says what to explore, with which finger, how finely."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, SerializeAsAny, ValidationError, model_validator

from explore3d import MeshFileError, SceneError, UnitError
from explore3d.scene.complaint import complaint
from explore3d.scene.finger import FingerTable, Setting, finger_table
from explore3d.scene.mesh_files import checked_mesh, load_mesh
from explore3d.scene.named_files import NamedFiles, with_files
from explore3d.scene.to_toml import scene_text
from explore3d.scene.tolerance import ToleranceTable
from explore3d.scene.values import (
    INFORMATIVE,
    Angle,
    Extent,
    Force,
    Length,
    LengthUnit,
    Point,
    Signed,
    SweepSpeed,
    Table,
    Time,
)
from hw import Finger
from mapping import KINDS, FloatArray, Surface, length_text
from mapping.detection import crest_like_groove, expected_limit
from mapping.instrument import Noise, StatedNoise
from mapping.model import Tolerance
from planners.survey import fastest_speed

SCENE_SCHEMA = "explore3d/scene/1"
# The slowest speed that is tried is this many times slower than the fastest: the height that white noise hides falls
# with its power 2/5, four times over the range, and what is still hidden then is better felt by many fast sweeps
SPEED_RANGE = 30.0
# Of sweeps where neither the scene names a speed nor noise and finger tell one, m/s: the paper's
USUAL_SPEED = 0.03


# In radii of the tip: a crest of 1e-5 shows over 1e-2 of them, too fine for a survey's lines over one body;
# noise of ten radii hides the fingertip itself; the ball sinks 1e-5 radii into a groove of 1e-2, and fills one of two
FINEST_FEATURE, COARSEST_FEATURE, MOST_NOISE = 1e-5, 1e3, 10.0
NARROWEST_GROOVE, WIDEST_GROOVE = 1e-2, 2.0
# A body of more than 1e5 radii is no fingertip's to survey; a tip of ten bodies feels no shape
CONTACT_ALGORITHMS = (1, 2)  # of the paper's figure 4
LARGEST_TIPS, LARGEST_TIP_SHARE = 1e5, 10.0


class Tip(Table):
    """The spherical fingertip: `radius` in metres, or a `profile` of explore3d calibrate that says it.

    With a `radius_sd` (m) above 0 the radius is known only up to that, and each posterior asks for it too; a profile
    says it unless the scene does.
    """

    radius: Length
    radius_sd: Extent = 0.0
    # beside a radius it only says where that came from (see _with_profile)
    profile: Annotated[Path | None, INFORMATIVE] = None


class Region(Table):
    """A box that bounds where to explore: `low` and `high` corners, m, object frame."""

    low: Point
    high: Point

    @model_validator(mode="after")
    def _has_volume(self) -> Region:
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError(f"low must lie below high in x, y and z; found low {self.low} and high {self.high} m")
        return self


Side = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class GlobalModel(Table):
    """What is known of the object beforehand: a mesh, whose file is in `units`, or merely a region.

    With pose = "estimate" the object may stand off the mesh by up to `shift` (m) and `turn` (rad). Of a mesh all sides
    are explored, or those that are named in `sides`; an unknown object is approached from them, or from above.
    """

    mesh: Path | None = None
    units: LengthUnit = "m"
    region: Region | None = None
    pose: Literal["given", "estimate"] = "given"
    shift: Length = 3e-3
    turn: Annotated[Angle, Field(gt=0)] = 0.035
    sides: Annotated[tuple[Side, ...], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _mesh_or_region(self) -> GlobalModel:
        if self.mesh is None and self.region is None:
            raise ValueError("give mesh, region, or both; without a mesh the base is fitted to the survey")
        return self

    @property
    def asked(self) -> dict[str, Any]:
        """Which part of a mesh is to be explored: arguments of `asked_part`."""
        return {"region": self.part, "sides": self.facing}

    @property
    def facing(self) -> FloatArray | None:
        """(S, 3) outward directions of the sides of the mesh that are to be explored; None: all, or no mesh."""
        if self.mesh is None or self.sides is None:
            return None
        return np.array([(1.0 if side[0] == "+" else -1.0) * np.eye(3)["xyz".index(side[1])] for side in self.sides])

    @property
    def part(self) -> tuple[FloatArray, FloatArray] | None:
        """Corners (3,), m, of the box that the part of the mesh to be explored lies in; None: all, or no mesh."""
        if self.mesh is None or self.region is None:
            return None
        return np.array(self.region.low), np.array(self.region.high)


class SurveyTable(Table):
    """Sweeps over the whole model: the least height and the least width of a groove to be found (m), the least span of
    a ridge (m), m/s, N.

    Without `shortest_ridge` nothing of that height is missed, bumps included; with it, ridges that span less may be.
    A groove is asked for by its width, for a ball that bridges it sinks no further than that lets it.
    The speed "fastest" is the greatest at which a sweep still shows the smallest feature (`Scene.sweep_speed`); so it
    is where none is named and that can be known.
    """

    smallest_feature: Length | None = None
    narrowest_groove: Length | None = None
    shortest_ridge: Length | None = None
    speed: SweepSpeed | None = None
    force: Force = 1.0

    @model_validator(mode="after")
    def _asks_for_something(self) -> SurveyTable:
        if self.smallest_feature is None and self.narrowest_groove is None:
            raise ValueError(
                "give survey.smallest_feature, survey.narrowest_groove, or both: what is to be found sets the sweeps"
            )
        return self

    def faintest(self, tip_radius: float) -> float:
        """Height of the faintest sharp crest that must not be missed, m: of the smallest feature, or as hard to see as
        the narrowest groove, whichever is less."""
        groove = inf if self.narrowest_groove is None else crest_like_groove(self.narrowest_groove, tip_radius)
        return min(self.smallest_feature or inf, groove)


class Detection(Table):
    """Which of the paper's four algorithms decides, and how many false alarms a metre may have."""

    algorithm: Annotated[int, Field(ge=1, le=4)] = 3
    false_alarms_per_metre: Annotated[float, Field(gt=0)] = 0.01


class Exploration(Table):
    """When to stop: `precision` of a feature's place (m), and the finger's time (s)."""

    precision: Length = 1e-4
    time_budget: Time = 600.0


class Truth(Table):
    """A feature that a simulated object really has: the report compares. Lengths in m, object frame."""

    kind: Literal[tuple(KINDS)]  # type: ignore[valid-type]
    axis: Annotated[tuple[Point, ...], Field(min_length=1)]
    height: Signed
    width: Length | None = None
    length: Extent | None = None


class About(Table):
    """Whose exploration it is: for people alone."""

    operator: Annotated[str, INFORMATIVE] = ""
    instrument: Annotated[str, INFORMATIVE] = ""
    part: Annotated[str, INFORMATIVE] = ""


class Scene(Table):
    """The whole file. Paths are absolute after loading; `path` is the file, `text` what stood in it."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    schema_: Literal["explore3d/scene/1"] = Field(alias="schema")
    title: str = ""
    about: About = About()
    seed: Annotated[int, Field(ge=0)] = 1
    tip: Tip
    model: GlobalModel
    finger: SerializeAsAny[FingerTable]
    survey: SurveyTable
    detection: Detection = Detection()
    explore: Exploration = Exploration()
    truth: tuple[Truth, ...] = ()
    tolerance: tuple[ToleranceTable, ...] = ()
    _path: Path = PrivateAttr(default=Path("scene.toml"))
    _text: str = PrivateAttr(default="")
    _meshes: Mapping[Path, Surface] = PrivateAttr(default_factory=dict)
    _is_recorded: bool = PrivateAttr(default=False)

    @model_validator(mode="after")
    def _within_reason(self) -> Scene:
        """Lengths that no unit but a wrong one gives are refused before anything is planned from them."""
        radius = self.tip.radius
        bounds = {
            "survey.smallest_feature": (self.survey.smallest_feature or radius, FINEST_FEATURE, COARSEST_FEATURE),
            "survey.narrowest_groove": (self.survey.narrowest_groove or radius, NARROWEST_GROOVE, WIDEST_GROOVE),
            "finger.noise.white": (self.finger.noise.white, 0.0, MOST_NOISE),
            "finger.noise.correlated": (self.finger.noise.correlated, 0.0, MOST_NOISE),
        }
        for field, (value, least, most) in bounds.items():
            if not least * radius <= value <= most * radius:
                raise ValueError(
                    f"{field} is {value:g} m, {value / radius:.3g} radii of the tip; possible: {least * radius:g} to "
                    f"{most * radius:g} m"
                )
        if self.detection.algorithm in CONTACT_ALGORITHMS and not self.finger.feels_normals:
            raise ValueError(
                f"detection.algorithm {self.detection.algorithm} needs contact normals, which this finger does not "
                "tell; possible: 3 and 4, or a simulated finger with contact_data = true"
            )
        return self

    @property
    def path(self) -> Path:
        """The file that the scene was read from."""
        return self._path

    @property
    def text(self) -> str:
        """The text of that file."""
        return self._text

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it names and that jobs read, as far as they are there."""
        found: dict[Path, None] = {}

        def keep(_: str, path: Path) -> Path:
            if path.is_file():
                found[path] = None
            return path

        with_files(self, keep)
        return tuple(found)

    @property
    def resolved(self) -> str:
        """The scene as TOML with every default written out, lengths in SI and paths absolute."""
        return scene_text(self.model_dump(mode="json", by_alias=True, exclude_none=True))

    @property
    def smallest(self) -> float:
        """Height of the faintest sharp crest that must not be missed, m (see SurveyTable.faintest)."""
        return self.survey.faintest(self.tip.radius)

    @property
    def noise(self) -> StatedNoise | None:
        """The noise of the centres as the scene states it, None where it states none."""
        told = self.finger.noise
        noise = Noise(told.white, told.correlated, told.correlation_length)
        return StatedNoise(noise, told.doubt) if noise.sd > 0 else None

    @property
    def expected_limit(self) -> float | None:
        """Height of a sharp crest that a sweep will show with 95 % probability, m, as far as the noise that the scene
        states foretells it; None where it states none, or nobody knows how often the finger samples."""
        follows = self.finger.follows(self.tip.radius, self.smallest)
        if self.noise is None or follows is None:
            return None
        spacing = self.sweep_speed / follows[1]
        return expected_limit(self.noise.noise, spacing, self.tip.radius, self.detection.false_alarms_per_metre)

    @property
    def tolerances(self) -> tuple[Tolerance, ...]:
        """What the drawing allows."""
        return tuple(each.tolerance() for each in self.tolerance)

    @property
    def sweep_speed(self) -> float:
        """Speed of the sweeps, m/s: as given, or the fastest at which one still shows the smallest feature.

        That is bounded by the noise, whose white part averages less where samples lie further apart
        (planners.survey.pace); by what the simulated finger can do, and by its inertia, if it has any
        (SimulatedFingerTable.follows). A scene that names no speed gets it where that can be known, else the paper's.

        Raises:
            SceneError: "fastest" is asked for, and the finger's noise or what it can follow is not known.
        """
        speed, smallest, tip = self.survey.speed, self.smallest, self.tip.radius
        if isinstance(speed, float):
            return speed
        follows = self.finger.follows(tip, smallest)
        if follows is not None and self.noise is not None:
            limit, rate = follows
            return fastest_speed(self.noise.noise, rate, tip, smallest, limit / SPEED_RANGE, limit)
        if speed is None:
            # a limit of nothing is that of a tip with inertia in no noise, which no speed leaves without an error
            return min(USUAL_SPEED, inf if follows is None else follows[0] or inf)
        if follows is None:
            raise SceneError(
                f"{self._path}: survey.speed: the fastest speed that a machine can follow is not known; found kind "
                f'"{self.finger.kind}", possible are a number as "20 mm/s", or the kind "simulated"'
            )
        raise SceneError(
            f"{self._path}: survey.speed: the fastest speed follows from the noise, and finger.noise states none; "
            'give white or correlated, or a number as "30 mm/s"'
        )

    def base_surface(self) -> Surface | None:
        """The global model's mesh in metres, None if only a region is known. Raises SceneError."""
        return None if self.model.mesh is None else self._surface("model.mesh", self.model.mesh, self.model.units)

    def object_surface(self) -> Surface:
        """The mesh that the simulated finger touches, in metres. Raises SceneError."""
        if self.finger.touched is None:
            raise SceneError(
                f"{self._path}: finger.object: no mesh to touch is given; a real finger touches the real thing"
            )
        return self._surface("finger.object", *self.finger.touched)

    def open_finger(self, armed: bool = False) -> Finger:
        """The finger that the scene names; entering it connects. Raises SceneError, FingerError.

        Args:
            armed: a real machine may move.
        """
        return self.finger.finger(self.setting(armed))

    def setting(self, armed: bool = False) -> Setting:
        """What the finger is told of this scene."""
        return Setting(
            scene=self._path,
            tip_radius=self.tip.radius,
            seed=self.seed,
            armed=armed,
            model=lambda: self.base_surface() if self.model.pose == "given" else None,
            mesh=lambda path, units: self._surface("finger.object", path, units),
        )

    def with_finger(self, finger: FingerTable) -> Scene:
        """The same scene with another finger."""
        return self.model_copy(update={"finger": finger})

    def _surface(self, field: str, mesh: Path, units: str) -> Surface:
        held = self._meshes.get(mesh)
        if held is None and self._is_recorded:
            raise SceneError(
                f"{self._path}: {field}: {mesh} is named by a recording; only a scene's own files are read"
            )
        try:
            surface = load_mesh(mesh, units) if held is None else checked_mesh(mesh, held)
        except (MeshFileError, UnitError) as error:
            raise SceneError(f"{self._path}: {field}: {error}") from error
        self.check_size(field, float(np.ptp(surface.vertices, axis=0).max()))
        return surface

    def check_size(self, field: str, size: float) -> None:
        """Refuse a body that is out of all proportion to the tip: its unit, or the radius', is wrong.

        Args:
            field: what says the size, for the message.
            size: greatest extent of the body, m.

        Raises:
            SceneError: the tip is too small or too large for it.
        """
        radius = self.tip.radius
        if not size / LARGEST_TIPS <= radius <= LARGEST_TIP_SHARE * size:
            raise SceneError(
                f"{self._path}: tip.radius: {length_text(radius)} for a body of {length_text(size)} ({field}); "
                f"possible: {length_text(size / LARGEST_TIPS)} to {length_text(LARGEST_TIP_SHARE * size)}; are the "
                "units of both the right ones?"
            )


def load_scene(path: Path | str, files_from: Collection[Path | str] = ()) -> Scene:
    """The scene in a TOML file; its relative paths count from the file's folder.

    Args:
        path: the file.
        files_from: folders, or files, that it may name beside those near it (explore3d.scene.named_files).

    Raises:
        SceneError: no such file, not TOML, an unknown or missing key, a value that is not possible, or a
            mesh file that does not exist; the message is one line that names the file and the field.
    """
    path = Path(path)
    if not path.is_file():
        raise SceneError(f"{path}: {'a folder, not a scene file' if path.is_dir() else 'no such scene file'}")
    try:
        text = path.read_text(encoding="utf-8-sig")  # a BOM of some editors is no part of it
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: not a readable scene file ({error})") from error
    return parse_scene(text, path, files_from=files_from)


def parse_scene(
    text: str,
    path: Path | str,
    meshes: Mapping[str, Surface] | None = None,
    files_from: Collection[Path | str] = (),
) -> Scene:
    """The scene in a text that stood, or might have stood, in the file `path`.

    Args:
        meshes: surfaces (m) that are held in memory, by the names that the text has for their files; None: none.
        files_from: as for load_scene.

    Raises:
        SceneError: see `load_scene`.
    """
    path = Path(path)
    held = {(path.resolve().parent / name).resolve(): each for name, each in (meshes or {}).items()}
    named = NamedFiles.of(path, files_from, held)
    scene = with_files(_parsed(text, path, named), named.place)
    scene._path, scene._text, scene._meshes = path, text, held
    _ = scene.sweep_speed  # a speed that cannot be known is refused here, as every other value
    return scene


def recorded_scene(text: str, path: Path | str) -> Scene:
    """The scene that a log holds: what it asks of the analysis. The files that it names are not opened.

    Raises:
        SceneError: see `load_scene`.
    """
    path = Path(path)
    scene = _parsed(text, path, None)
    scene._path, scene._text, scene._is_recorded = path, text, True
    _ = scene.sweep_speed
    return scene


def _parsed(text: str, path: Path, named: NamedFiles | None) -> Scene:
    """The scene as it stands there; without `named` it may name no tip profile that would have to be read."""
    try:
        tables = _with_profile(tomllib.loads(text), path, named)
        if isinstance(tables.get("finger"), dict):
            tables |= {"finger": finger_table(tables["finger"])}
        return Scene.model_validate(tables)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{path}: not valid TOML: {error}") from error
    except ValidationError as error:
        raise SceneError(f"{path}: {complaint(error, Scene)}") from error
    except SceneError as error:
        raise error if str(error).startswith(f"{path}: ") else SceneError(f"{path}: {error}") from error


def _with_profile(tables: dict[str, Any], path: Path, named: NamedFiles | None) -> dict[str, Any]:
    """The tables with the tip radius of the tip profile that they name, and how well it is known."""
    tip = tables.get("tip")
    if named is None or not isinstance(tip, dict) or not isinstance(tip.get("profile"), str) or "radius" in tip:
        return tables  # beside a radius the profile only says where it came from, as in a resolved scene
    profile = named.place("tip.profile", Path(tip["profile"]))
    try:
        known = tomllib.loads(profile.read_text(encoding="utf-8"))
        radius, doubt = known["radius"], {"radius_sd": known["radius_sd"]}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError) as error:
        raise SceneError(f"{path}: tip.profile: {profile}: not a tip profile of calibrate ({error})") from error
    return tables | {"tip": doubt | tip | {"radius": radius, "profile": str(profile)}}
