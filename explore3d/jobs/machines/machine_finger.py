"""The finger of a scene that is a real machine of the Grbl family, or an emulated one started beside the run."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import SerializeAsAny, model_validator

from explore3d import SceneError
from explore3d.jobs.machines.emulate import Emulation, EmulatorProcess
from explore3d.scene import EMULATOR, FingerTable, LengthUnit, MachineTable, SensorTable, Setting
from hw import Finger, Move
from hw.grbl import StageFrame
from hw.probing import GrblFinger, Peck, Slide
from mapping import FloatArray


class GrblFingerTable(FingerTable):
    """A machine of the Grbl family, described in `machine`, its force sensor in `sensor`; one that is emulated touches
    the mesh `object`.
    """

    kind: Literal["grbl"] = "grbl"
    object: Path | None = None
    units: LengthUnit = "m"
    machine: MachineTable
    sensor: SerializeAsAny[SensorTable | None] = None

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> GrblFingerTable:
        if self.machine.touch == "slide" and self.sensor is None:
            raise ValueError("sliding needs a force sensor: give the table finger.sensor")
        if (self.machine.low is None) != (self.machine.high is None):
            raise ValueError("machine: give both low and high, or neither")
        if not self.is_real and self.object is None:
            raise ValueError("object is missing: the mesh that the emulated machine touches")
        if not self.is_real and self.sensor is not None and not self.sensor.emulated:
            raise ValueError(f"sensor: the kind {self.sensor.kind} cannot be emulated; give machine.port a real one")
        return self

    @property
    def feels_normals(self) -> bool:
        """Where a force sensor slides along: a touch probe tells places alone."""
        return self.machine.touch == "slide"

    @property
    def is_real(self) -> bool:
        """False where its port is the emulator."""
        return self.machine.port != EMULATOR

    @property
    def touched(self) -> tuple[Path, str] | None:
        """Mesh and unit of what the emulated machine touches."""
        return None if self.object is None else (self.object, self.units)

    def touches(self, move: Move, tip_radius: float) -> tuple[FloatArray, FloatArray] | None:
        """Where it pecks."""
        return _peck(self.machine, tip_radius).places(move) if self.machine.touch == "peck" else None

    def finger(self, setting: Setting) -> Finger:
        """It pecks, or slides; an emulated one brings its emulator along."""
        machine, sensor, radius = self.machine, self.sensor, setting.tip_radius
        beside: AbstractContextManager[Any] = nullcontext()
        port, sensor_port = machine.port, None
        if not self.is_real:
            beside = process = EmulatorProcess(self.emulation(setting))
            port, sensor_port = process.ports
        return GrblFinger(
            port=port,
            tip_radius=radius,
            frame=StageFrame.of(machine.origin, machine.turn),
            peck=_peck(machine, radius) if machine.touch == "peck" else None,
            slide=_slide(sensor, sensor_port, radius) if machine.touch == "slide" and sensor else None,
            armed=setting.armed or not self.is_real,
            travel_speed=machine.travel_speed,
            over_travel=machine.over_travel,
            max_force=machine.max_force,
            limits=None if machine.low is None else np.array([machine.low, machine.high]),
            unlock=machine.unlock,
            home=machine.home,
            baudrate=machine.baudrate,
            beside=beside,
            position_known=machine.position_known or not self.is_real,  # an emulator is where it says
            surface=setting.model(),
            beyond=machine.beyond,
            ask=_ask if self.is_real and machine.check_probe else None,
        )

    def emulation(self, setting: Setting) -> Emulation:
        """What its emulator must be like. Raises SceneError."""
        machine, sensor = self.machine, self.sensor
        if self.object is None:
            raise SceneError(f"{setting.scene}: finger.object: an emulated machine needs a mesh to touch")
        felt = machine.touch == "slide" and sensor is not None
        told = {} if sensor is None else sensor.model_dump()
        return Emulation(
            mesh=self.object,
            units=self.units,
            tip_radius=setting.tip_radius,
            origin=machine.origin,
            turn=machine.turn,
            sensor=told["kind"] if felt else None,
            sensor_turn=told.get("turn", (0.0, 0.0, 0.0)),
            stiffness=told.get("stiffness", 2e4),
            counts_per_newton=told.get("counts_per_newton", (400.0,))[0],
            force_noise=told.get("noise", 0.003),
            repeatability=machine.repeatability,
            pace=machine.pace,
            seed=setting.seed,
        )


def _ask(what: str) -> None:
    """Ask the user at the machine; standard output may be a record that another program reads."""
    print(what, file=sys.stderr, flush=True)


def _peck(machine: MachineTable, tip_radius: float) -> Peck:
    return Peck(machine.step, machine.clearance, machine.probe_speed, stroke=tip_radius)


def _slide(sensor: SensorTable, emulated_port: str | None, tip_radius: float) -> Slide:
    device = sensor.sensor(emulated_port)
    device.turned = StageFrame.of(turn=sensor.turn).rotation
    return Slide(
        device,
        sensor.stiffness,
        period=sensor.period,
        approach_speed=sensor.approach_speed,
        reach=tip_radius,
        delay=sensor.delay,
    )
