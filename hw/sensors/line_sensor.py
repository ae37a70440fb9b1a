"""LineSensor: the line protocol for home-made force sensors (Arduino class); a sketch is in docs/hardware.md.

    F,<micros>,<fx>,<fy>,<fz>*<hh>

micros: the board's clock, u32, microseconds (wraps); fx, fy, fz: force on the tip, N, decimal; hh: two hex digits,
the exclusive or of all characters before the `*`. One line per sample, ended by LF or CR LF, at any baud rate.
Lines that begin with `#` are comments. The board need not listen.
"""

from __future__ import annotations

import numpy as np

from hw import Lines
from hw.sensors.force_sensor import ForceSensor
from mapping import FloatArray, IntArray


def encode_line(micros: int, force: tuple[float, float, float]) -> bytes:
    """A line, with its end."""
    body = f"F,{micros % 2**32},{force[0]:.5f},{force[1]:.5f},{force[2]:.5f}".encode("ascii")
    return body + f"*{xor_of(body):02X}\n".encode("ascii")


def xor_of(body: bytes) -> int:
    """The exclusive or of all bytes: the upper half onto the lower one, until one byte is left."""
    folded = int.from_bytes(body, "little")
    half = 4 << len(body).bit_length()
    while half >= 8:
        folded ^= folded >> half
        half >>= 1
    return folded & 0xFF


def decode(line: bytes) -> tuple[int, float, float, float] | None:
    """Microseconds and force in a line without its end; None if it is not a whole one."""
    body, star, check = line.partition(b"*")
    parts = body.split(b",")
    if not star or len(parts) != 5 or parts[0] != b"F":
        return None
    try:
        if int(check, 16) != xor_of(body):
            return None
        return int(parts[1]) % 2**32, float(parts[2]), float(parts[3]), float(parts[4])
    except ValueError:
        return None


class LineSensor(ForceSensor):
    """A home-made sensor on a serial port.

    Args:
        port: device name or pyserial URL.
        rate: samples per second that it sends, about.
        baudrate: of the port.
    """

    name = "line sensor"

    def __init__(self, port: str, *, rate: float = 500.0, baudrate: int = 115200) -> None:
        super().__init__(port, Lines(), rate=rate, bits=32, tick=1e-6, baudrate=baudrate)

    def decode(self, frame: bytes) -> tuple[int, float, float, float] | None:
        """Microseconds and force in a line."""
        return decode(frame)

    def decode_all(self, frames: list[bytes]) -> tuple[IntArray, FloatArray] | None:
        """Microseconds and forces in lines; None if one is not whole."""
        from hw.sensors.sample_kernels import read_lines

        counts, forces = np.empty(len(frames), np.int64), np.empty((len(frames), 3))
        if read_lines(np.frombuffer(b"\n".join(frames) + b"\n", np.uint8), counts, forces):
            return counts, forces
        return super().decode_all(frames)
