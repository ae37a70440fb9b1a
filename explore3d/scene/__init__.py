"""Scenes: what to explore, with what, how; read from TOML and checked."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.scene.begin import FINGER_KINDS as FINGER_KINDS, begin_scene as begin_scene
    from explore3d.scene.complaint import complaint as complaint
    from explore3d.scene.examples import (
        SCENE_FILE as SCENE_FILE,
        Example as Example,
        copy_example as copy_example,
        example as example,
        examples as examples,
        programs as programs,
    )
    from explore3d.scene.finger import (
        FINGER_GROUP as FINGER_GROUP,
        SENSOR_GROUP as SENSOR_GROUP,
        FingerNoise as FingerNoise,
        FingerTable as FingerTable,
        GivenFingerTable as GivenFingerTable,
        SensorTable as SensorTable,
        Setting as Setting,
    )
    from explore3d.scene.machine import (
        EMULATOR as EMULATOR,
        MIDDLE_OF_TRAVEL as MIDDLE_OF_TRAVEL,
        LineSensorTable as LineSensorTable,
        MachineTable as MachineTable,
        OptoForceTable as OptoForceTable,
    )
    from explore3d.scene.mesh_files import (
        extent_text as extent_text,
        load_mesh as load_mesh,
        mesh_text as mesh_text,
    )
    from explore3d.scene.scene import (
        Scene as Scene,
        load_scene as load_scene,
        parse_scene as parse_scene,
        recorded_scene as recorded_scene,
    )
    from explore3d.scene.settings import AnalysisSettings as AnalysisSettings
    from explore3d.scene.simulated import SimulatedFingerTable as SimulatedFingerTable
    from explore3d.scene.to_toml import scene_text as scene_text
    from explore3d.scene.tolerance import ToleranceTable as ToleranceTable, read_tolerances as read_tolerances
    from explore3d.scene.values import (
        Angle as Angle,
        Delay as Delay,
        Extent as Extent,
        Force as Force,
        Length as Length,
        LengthUnit as LengthUnit,
        Point as Point,
        Rate as Rate,
        Speed as Speed,
        Table as Table,
        Turn as Turn,
    )

_PUBLIC = {
    "begin": ("FINGER_KINDS", "begin_scene"),
    "complaint": ("complaint",),
    "examples": ("Example", "SCENE_FILE", "copy_example", "example", "examples", "programs"),
    "finger": (
        "FINGER_GROUP",
        "SENSOR_GROUP",
        "FingerNoise",
        "FingerTable",
        "GivenFingerTable",
        "SensorTable",
        "Setting",
    ),
    "machine": ("EMULATOR", "MIDDLE_OF_TRAVEL", "LineSensorTable", "MachineTable", "OptoForceTable"),
    "mesh_files": ("extent_text", "load_mesh", "mesh_text"),
    "scene": ("Scene", "load_scene", "parse_scene", "recorded_scene"),
    "settings": ("AnalysisSettings",),
    "simulated": ("SimulatedFingerTable",),
    "to_toml": ("scene_text",),
    "tolerance": ("ToleranceTable", "read_tolerances"),
    "values": ("Angle", "Delay", "Extent", "Force", "Length", "LengthUnit", "Point", "Rate", "Speed", "Table", "Turn"),
}
doorway(__name__, _PUBLIC)
