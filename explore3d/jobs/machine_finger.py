"""The finger of a scene that is a real machine, or an emulated one started beside the run."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from explore3d import SceneError
from explore3d.jobs.emulate import Emulation, EmulatorProcess
from explore3d.scene import EMULATOR, MachineTable, Scene, SensorTable
from hw import Finger, open_finger
from hw.grbl import StageFrame
from hw.probing import Peck, Slide
from hw.sensors import ForceSensor, LineSensor, OptoForce
from mapping import Surface


def needs_arming(scene: Scene) -> bool:
    """True if the scene's finger is a real machine: without --arm nothing of it may move."""
    return scene.finger.machine is not None and scene.finger.machine.port != EMULATOR


def machine_finger(scene: Scene, armed: bool) -> Finger:
    """The finger, not yet connected: entering it opens its ports. Raises SceneError, FingerError."""
    machine, sensor = scene.finger.machine, scene.finger.sensor
    assert machine is not None
    if (machine.low is None) != (machine.high is None):
        raise SceneError(f"{scene.path}: finger.machine: give both low and high, or neither")
    beside: AbstractContextManager[Any] = nullcontext()
    ports = [machine.port, "" if sensor is None else sensor.port]
    if not needs_arming(scene):
        beside = process = EmulatorProcess(emulation(scene))
        ports = process.ports
    return open_finger(
        "grbl",
        port=ports[0],
        tip_radius=scene.tip.radius,
        frame=StageFrame.of(machine.origin, machine.turn),
        peck=_peck(machine, scene.tip.radius) if machine.touch == "peck" else None,
        slide=_slide(sensor, ports[1], scene.tip.radius) if machine.touch == "slide" and sensor else None,
        armed=armed or not needs_arming(scene),
        travel_speed=machine.travel_speed,
        over_travel=machine.over_travel,
        max_force=machine.max_force,
        limits=None if machine.low is None else np.array([machine.low, machine.high]),
        unlock=machine.unlock,
        home=machine.home,
        baudrate=machine.baudrate,
        beside=beside,
        position_known=machine.position_known or not needs_arming(scene),  # an emulator is where it says
        surface=_expected(scene),
        beyond=machine.beyond,
        ask=_ask if needs_arming(scene) and machine.check_probe else None,
    )


def _expected(scene: Scene) -> Surface | None:
    """Where the body is, as far as it is known to more than a guess: the model's mesh, at the pose that it has."""
    return scene.base_surface() if scene.model.pose == "given" else None


def _ask(what: str) -> None:
    """Ask the user at the machine; standard output may be a record that another program reads."""
    print(what, file=sys.stderr, flush=True)


def emulation(scene: Scene) -> Emulation:
    """What the emulator of a scene must be like. Raises SceneError."""
    machine, sensor = scene.finger.machine, scene.finger.sensor
    if machine is None or scene.finger.object is None:
        raise SceneError(f"{scene.path}: finger: an emulated machine needs finger.machine and finger.object")
    return Emulation(
        mesh=scene.finger.object,
        units=scene.finger.units,
        tip_radius=scene.tip.radius,
        origin=machine.origin,
        turn=machine.turn,
        sensor=None if machine.touch == "peck" or sensor is None else sensor.kind,
        stiffness=2e4 if sensor is None else sensor.stiffness,
        counts_per_newton=400.0 if sensor is None else sensor.counts_per_newton[0],
        force_noise=0.003 if sensor is None else sensor.noise,
        repeatability=machine.repeatability,
        pace=machine.pace,
        seed=scene.seed,
    )


def _peck(machine: MachineTable, tip_radius: float) -> Peck:
    return Peck(machine.step, machine.clearance, machine.probe_speed, stroke=tip_radius)


def _slide(sensor: SensorTable, port: str, tip_radius: float) -> Slide:
    device: ForceSensor = (
        OptoForce(port, sensor.counts_per_newton, rate=int(sensor.rate))
        if sensor.kind == "optoforce"
        else LineSensor(port, rate=sensor.rate, baudrate=sensor.baudrate)
    )
    return Slide(
        device,
        sensor.stiffness,
        period=sensor.period,
        approach_speed=sensor.approach_speed,
        reach=tip_radius,
        delay=sensor.delay,
    )
