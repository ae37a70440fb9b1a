"""Tables of a scene whose finger is a real machine: [finger.machine], and our sensors for [finger.sensor]."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from explore3d.scene.finger import SensorTable
from explore3d.scene.values import Extent, Force, Length, Point, Rate, Speed, Table, Turn
from hw.sensors import ForceSensor, LineSensor, OptoForce

# The port that means: start the emulator beside the run
EMULATOR = "emulator"
# Machine coordinates of the object's origin, where none are known yet: in the middle of an emulated machine's travel
MIDDLE_OF_TRAVEL = ("-150 mm", "-150 mm", "-60 mm")


class MachineTable(Table):
    """A stage of the Grbl family.

    Args:
        port: its serial port, or "emulator": an emulated machine that touches finger.object is started.
        origin: machine coordinates of the object's origin (m).
        turn: rotation vector that turns the object's axes into the machine's (rad).
        touch: "peck" needs a touch probe, "slide" a force sensor.
        step, clearance: between pecks along the path, and above the body (m).
        probe_speed, travel_speed: m/s.
        over_travel: how far the tip may run on after contact (m).
        max_force: N.
        low, high: machine coordinates that the tip may take, within the controller's own limits (m).
        unlock, home: on connecting; homing moves the machine.
        position_known: you vouch that it was homed since it was switched on; holds until the controller restarts.
        beyond: how far the tip may go beyond the surface of the model without feeling it (m); else as far as the force
            limit reaches by the stiffness of the sensor, or over_travel with a touch probe.
        check_probe: ask for a touch of the probe by hand before the first peck of a real machine.
        pace, repeatability: of the emulator: its seconds per second, and the scatter of its probe (m).
    """

    port: str
    baudrate: Annotated[int, Field(gt=0)] = 115200
    origin: Point = (0.0, 0.0, 0.0)
    turn: tuple[Turn, Turn, Turn] = (0.0, 0.0, 0.0)
    touch: Literal["peck", "slide"] = "peck"
    step: Length = 5e-4
    clearance: Length = 5e-4
    probe_speed: Speed = 5e-3
    travel_speed: Speed = 0.03
    over_travel: Length = 5e-4
    max_force: Force = 5.0
    low: Point | None = None
    high: Point | None = None
    unlock: bool = False
    home: bool = False
    position_known: bool = False
    beyond: Length | None = None
    check_probe: bool = True
    pace: Annotated[float, Field(gt=0)] = 1.0
    repeatability: Extent = 0.0


class OptoForceTable(SensorTable):
    """An OptoForce on its data acquisition unit.

    Args:
        port: its serial port; with an emulated machine it is emulated too, and none is given.
        counts_per_newton: by its sensitivity sheet: one for each axis.
        rate: Hz.
        noise: of the emulated sensor, each component (N); above 0: one without noise cannot be told from a frozen one.
    """

    kind: Literal["optoforce"] = "optoforce"
    port: str = EMULATOR
    counts_per_newton: tuple[float, float, float] = (400.0, 400.0, 400.0)
    rate: Rate = 1000.0
    noise: Annotated[float, Field(ge=0)] = 0.003

    emulated: ClassVar[bool] = True

    def sensor(self, emulated_port: str | None) -> ForceSensor:
        """On its own port, or its emulator's."""
        return OptoForce(emulated_port or self.port, self.counts_per_newton, rate=int(self.rate))


class LineSensorTable(SensorTable):
    """A home-made sensor that speaks the line protocol.

    Args:
        port, baudrate: its serial port; with an emulated machine it is emulated too, and none is given.
        rate: Hz, about.
        noise: of the emulated sensor, each component (N).
    """

    kind: Literal["line"] = "line"
    port: str = EMULATOR
    baudrate: Annotated[int, Field(gt=0)] = 115200
    rate: Rate = 1000.0
    noise: Annotated[float, Field(ge=0)] = 0.003

    emulated: ClassVar[bool] = True

    def sensor(self, emulated_port: str | None) -> ForceSensor:
        """On its own port, or its emulator's."""
        return LineSensor(emulated_port or self.port, rate=self.rate, baudrate=self.baudrate)
