"""OptoForce / OnRobot three-axis sensor (hemispherical or flat) on its USB data acquisition unit.

Data frame, 16 bytes, big-endian: header 170 7 8 10; counter u16; status u16; Fx, Fy, Fz i16; checksum u16, the
sum of the 14 bytes before it. Configuration frame, 9 bytes: 170 0 50 3; speed; filter; zero; checksum u16.
Status: bits 15-13 error of the unit, 12-10 of the sensor, 9-7 overload of Fx, Fy, Fz.
Reference: OptoForce General DAQ protocol, as in the drivers of Shadow Robot and alknemeyer/optoforce.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike

from hw import FingerError, Frames
from hw.sensors.force_sensor import ForceSensor
from mapping import FloatArray, IntArray

HEADER = bytes((170, 7, 8, 10))
FRAME_BYTES = 16
CONFIGURE = bytes((170, 0, 50, 3))
RATE_CODES = {0: 0, 1000: 1, 333: 3, 100: 10, 30: 33, 10: 100}
FILTERS = {0.0: 0, 500.0: 1, 150.0: 2, 50.0: 3, 15.0: 4, 5.0: 5, 1.5: 6}
BAUDRATE = 1_000_000
DISTRUST = 0xFC00  # any error of unit or sensor
OVERLOAD = 0x0380  # of Fx, Fy, Fz: the value is clipped

_BODY = struct.Struct(">4sHHhhhH")
_HEADER = np.frombuffer(HEADER, np.uint8)


def checksum(data: bytes) -> int:
    """Sum of the bytes, 16 bits."""
    return sum(data) & 0xFFFF


def is_whole(frame: bytes) -> bool:
    """True if the checksum of a data frame is right."""
    high, low = frame[-2:]
    return sum(frame) - high - low & 0xFFFF == high << 8 | low


def are_whole(block: bytes) -> bool:
    """True if headers and checksums of data frames, one behind another, are right."""
    from hw.sensors.sample_kernels import whole_frames

    return bool(whole_frames(np.frombuffer(block, np.uint8), _HEADER, FRAME_BYTES))


def encode_frame(counter: int, status: int, counts: tuple[int, int, int]) -> bytes:
    """A data frame."""
    body = _BODY.pack(HEADER, counter & 0xFFFF, status, *counts, 0)[:-2]
    return body + struct.pack(">H", checksum(body))


def configuration(speed: int, low_pass: float, zero: bool) -> bytes:
    """The frame that sets the rate (Hz; 0 stops), the filter's cut-off (Hz; 0: none) and the zero.

    Raises:
        FingerError: a rate or cut-off that the device does not have.
    """
    if speed not in RATE_CODES or low_pass not in FILTERS:
        raise FingerError(f"optoforce: possible rates {sorted(RATE_CODES)} Hz, filters {sorted(FILTERS)} Hz")
    body = CONFIGURE + bytes((RATE_CODES[speed], FILTERS[low_pass], 255 if zero else 0))
    return body + struct.pack(">H", checksum(body))


class OptoForce(ForceSensor):
    """The sensor on a serial port.

    Args:
        port: device name or pyserial URL.
        counts_per_newton: number, or one per axis, from the sensor's own sensitivity sheet.
        rate: of its samples, Hz: 1000, 333, 100, 30 or 10.
        low_pass: cut-off of its filter, Hz: 500, 150, 50, 15, 5, 1.5, or 0 for none.
    """

    name = "OptoForce sensor"

    def __init__(self, port: str, counts_per_newton: ArrayLike, *, rate: int = 1000, low_pass: float = 150.0) -> None:
        self._setting = configuration(rate, float(low_pass), False)
        x, y, z = np.broadcast_to(np.asarray(counts_per_newton, dtype=np.float64), 3)
        self._scale = (1.0 / float(x), 1.0 / float(y), 1.0 / float(z))
        self._scales = np.array(self._scale)
        super().__init__(port, Frames(HEADER, FRAME_BYTES, is_whole, are_whole), rate=rate, bits=16, baudrate=BAUDRATE)

    def start(self) -> None:
        """Set rate and filter; the zero is taken by `tare`, so that the device's own is left as it is."""
        self.link.write(self._setting)

    def decode(self, frame: bytes) -> tuple[int, float, float, float] | None:
        """Count and force in a frame; None if the device reports an error."""
        _, counter, status, x, y, z, _ = _BODY.unpack(frame)
        if status & DISTRUST:
            return None
        if status & OVERLOAD:  # more than it can say, and more than any limit
            return counter, *(np.inf if status & bit else 0.0 for bit in (1 << 9, 1 << 8, 1 << 7))
        return counter, x * self._scale[0], y * self._scale[1], z * self._scale[2]

    def decode_all(self, frames: list[bytes]) -> tuple[IntArray, FloatArray] | None:
        """Counts and forces in frames; None if the device reports an error or an overload in one of them."""
        from hw.sensors.sample_kernels import read_frames

        counts, forces = np.empty(len(frames), np.int64), np.empty((len(frames), 3))
        block = np.frombuffer(b"".join(frames), np.uint8)
        whole = read_frames(block, DISTRUST | OVERLOAD, self._scales, counts, forces)
        return (counts, forces) if whole else None
