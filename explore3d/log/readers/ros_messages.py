"""What the messages of robots say of positions and forces: of ROS, and the same in JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

_POSES = frozenset(("PoseStamped", "PoseWithCovarianceStamped", "Odometry"))
_KINDS = _POSES | {"PointStamped", "TransformStamped", "PointCloud2", "TFMessage", "tfMessage", "WrenchStamped"}
# sensor_msgs/PointField: number of a type -> type
_FIELDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True)
class Felt:
    """A position, a cloud, or a force.

    Args:
        source: the topic; of TF with the child frame behind a colon.
        frame: that the numbers are in.
        t: time of the message, s.
        points: (K, 3), m or N.
        force: True if it is a force.
        cloud: True if it is a cloud.
        metres: False if nothing says in which unit.
    """

    source: str
    frame: str
    t: float
    points: np.ndarray
    force: bool = False
    cloud: bool = False
    metres: bool = True


def known(kind: str) -> bool:
    """True for types of messages that hold positions or forces: "geometry_msgs/msg/PoseStamped"."""
    return kind.rpartition("/")[2] in _KINDS


def of_ros(topic: str, kind: str, message: Any, stamp: int) -> Iterator[Felt]:
    """What a message of ROS says; lengths are metres and forces newtons there (REP 103).

    Args:
        topic, kind: its topic, and its type.
        message: as rosbags gives it.
        stamp: time of its recording, ns: for messages without a time of their own.
    """
    word = kind.rpartition("/")[2]
    if word in ("TFMessage", "tfMessage"):
        for each in message.transforms:
            t, frame = _stamp(each.header, stamp)
            yield Felt(f"{topic}:{each.child_frame_id}", frame, t, _vector(each.transform.translation))
        return
    t, frame = _stamp(message.header, stamp)
    if word == "WrenchStamped":
        yield Felt(topic, frame, t, _vector(message.wrench.force), force=True)
    elif word == "PointCloud2":
        yield Felt(topic, frame, t, _cloud(message), cloud=True)
    elif word == "PointStamped":
        yield Felt(topic, frame, t, _vector(message.point))
    elif word == "TransformStamped":
        yield Felt(topic, frame, t, _vector(message.transform.translation))
    elif word in _POSES:
        pose = message.pose if word == "PoseStamped" else message.pose.pose
        yield Felt(topic, frame, t, _vector(pose.position))


def _stamp(header: Any, recorded: int) -> tuple[float, str]:
    t = header.stamp.sec + 1e-9 * header.stamp.nanosec
    return (t if t > 0 else 1e-9 * recorded), str(header.frame_id)


def _vector(value: Any) -> np.ndarray:
    return np.array([[value.x, value.y, value.z]], dtype=np.float64)


def _cloud(message: Any) -> np.ndarray:
    """(K, 3) points of a PointCloud2 in their order; those that are not finite are left out."""
    fields = {each.name: each for each in message.fields}
    if not {"x", "y", "z"} <= fields.keys():
        raise ValueError(f"a cloud without x, y, z: {', '.join(fields)}")
    order = ">" if message.is_bigendian else "<"
    layout = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [order + _FIELDS[fields[axis].datatype] for axis in "xyz"],
            "offsets": [fields[axis].offset for axis in "xyz"],
            "itemsize": message.point_step,
        }
    )
    rows, width, data = int(message.height), int(message.width), np.ascontiguousarray(message.data).view(np.uint8)
    if rows * message.row_step > len(data) or width * message.point_step > message.row_step:
        raise ValueError(f"a cloud of {rows} x {width} points in {len(data)} bytes")
    lines = [np.frombuffer(data, layout, width, line * message.row_step) for line in range(rows if width else 0)]
    points = np.concatenate(lines) if lines else np.zeros(0, layout)
    found = np.column_stack([points[axis].astype(np.float64) for axis in "xyz"])
    return found[np.isfinite(found).all(axis=1)]


# Where a message in JSON may hold its position: of ROS, of Foxglove, and bare
_POSITIONS = (
    ("pose", "pose", "position"),
    ("pose", "position"),
    ("point",),
    ("position",),
    ("transform", "translation"),
    ("translation",),
    (),
)
_STATED = ("geometry_msgs", "nav_msgs", "sensor_msgs", "foxglove")  # whose lengths are metres by definition


def of_json(topic: str, kind: str, message: Any, stamp: int) -> Iterator[Felt]:
    """What a message in JSON says, if it holds a position or a force in one of the usual places; as of_ros."""
    if not isinstance(message, Mapping):
        return
    header = message.get("header", message)
    frame = str(header.get("frame_id", message.get("frame_id", "")) if isinstance(header, Mapping) else "")
    t = _json_time(header.get("stamp", message.get("timestamp")) if isinstance(header, Mapping) else None, stamp)
    metres = kind.startswith(_STATED)
    force = _at(message, ("wrench", "force")) or _at(message, ("force",))
    if force is not None:
        yield Felt(topic, frame, t, force[0], force=True)
        return
    for way in _POSITIONS:
        if (found := _at(message, way)) is not None:
            yield Felt(topic, frame, t, found[0], metres=metres)
            return


def _at(message: Any, way: tuple[str, ...]) -> tuple[np.ndarray] | None:
    """The vector at a place of a message, None if there is none."""
    for name in way:
        message = message.get(name) if isinstance(message, Mapping) else None
    if not isinstance(message, Mapping):
        return None
    values = [message.get(axis) for axis in "xyz"]
    if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return None
    return (np.array([values], dtype=np.float64),)


def _json_time(stamp: Any, recorded: int) -> float:
    if isinstance(stamp, Mapping) and isinstance(seconds := stamp.get("sec", stamp.get("secs")), int):
        nanos = next((stamp[key] for key in ("nanosec", "nsec", "nsecs") if isinstance(stamp.get(key), int)), 0)
        return seconds + 1e-9 * nanos
    return 1e-9 * recorded
