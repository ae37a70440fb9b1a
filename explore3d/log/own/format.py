"""The log's format: topics, fields and JSON schemas. docs/log.md explains it to people."""

from __future__ import annotations

import json

import numpy as np

MAGIC = b"\x89MCAP0\r\n"
VERSION = "explore3d/log/1"
FRAME = "object"

TRACE_TOPIC, PATH_TOPIC, FELT_TOPIC = "/trace", "/path", "/felt"

# fields of a sample: t, centre and sweep always, the others if the finger felt them
REQUIRED_FIELDS = (("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("t", "<f8"), ("sweep", "<i4"))
OPTIONAL_FIELDS = {"normals": ("nx", "ny", "nz"), "contacts": ("cx", "cy", "cz"), "force": ("fx", "fy", "fz")}

SAMPLES_PER_MESSAGE = 500
# a record that says it is larger is damage; the writer makes none (chunks stay near 1 MiB, but an event may be long)
LARGEST_RECORD = 1 << 30


def sample_dtype(optional: tuple[str, ...] = ()) -> np.dtype[np.void]:
    """One packed sample with the named optional fields of a trace."""
    extra = [(name, "<f8") for group in optional for name in OPTIONAL_FIELDS[group]]
    return np.dtype([*REQUIRED_FIELDS, *extra])


def _vector(text: str) -> dict[str, object]:
    return {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3, "description": text}


def _schema(title: str, text: str, properties: dict[str, object]) -> bytes:
    fields = {"type": "object", "title": title, "description": text, "properties": properties}
    return json.dumps(fields | {"required": list(properties)}).encode()


_TIME: dict[str, object] = {"type": ["number", "null"], "description": "s, on the clock of the samples; null: none yet"}

# name of the event -> (topic, JSON schema); every other kind goes to /event
EVENTS = {
    "start": (
        "/start",
        _schema(
            "explore3d.Start",
            "The first message: all that a reader needs besides the samples.",
            {
                "schema": {"const": VERSION},
                "tip_radius": {"type": "number", "exclusiveMinimum": 0, "description": "radius of the fingertip, m"},
                "resolution": {"type": "number", "minimum": 0, "description": "step of the positions, m; 0: none"},
                "frame": {"type": "string", "description": "frame of all coordinates"},
                "started": {"type": ["string", "null"], "description": "ISO 8601 time of t = 0; null: simulated"},
                "scene": {"type": "string", "description": "text of the scene file; empty: none"},
                "metadata": {"type": "object", "description": "versions, seed, finger: what the writer was told"},
            },
        ),
    ),
    "move": (
        "/move",
        _schema(
            "explore3d.Move",
            "One commanded motion, written just before the samples that it gave.",
            {
                "t": _TIME,
                "purpose": {"enum": ["travel", "approach", "sweep", "retreat"]},
                "path": {"type": "array", "items": _vector("commanded centre of the tip, m")},
                "approach": {"type": "array", "items": _vector("unit direction of pressing at that waypoint")},
                "speed": {"type": "number", "description": "m/s"},
                "force": {"type": "number", "description": "N"},
                "first": {"type": "integer", "description": "number of its first sample in the whole log, from 0"},
                "samples": {"type": "integer", "description": "how many samples follow"},
            },
        ),
    ),
    "event": (
        "/event",
        _schema(
            "explore3d.Event",
            "Anything else worth keeping: a detection, a decision, a fault.",
            {"t": _TIME, "kind": {"type": "string"}, "data": {"type": "object"}},
        ),
    ),
    "end": (
        "/end",
        _schema(
            "explore3d.End",
            "The last message of a log that was closed; a killed log has none.",
            {"t": _TIME, "samples": {"type": "integer"}, "reason": {"type": "string"}},
        ),
    ),
}


def _axes(title: str, axes: str) -> dict[str, object]:
    return {"type": "object", "title": title, "properties": {axis: {"type": "number"} for axis in axes}}


_POSE: dict[str, object] = {
    "type": "object",
    "title": "foxglove.Pose",
    "properties": {"position": _axes("foxglove.Vector3", "xyz"), "orientation": _axes("foxglove.Quaternion", "xyzw")},
}
_STAMP: dict[str, object] = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
}
PATH_SCHEMA = _schema(
    "foxglove.PosesInFrame",
    "Waypoints of the commanded move; the x axis of each pose is the direction of pressing.",
    {"timestamp": _STAMP, "frame_id": {"type": "string"}, "poses": {"type": "array", "items": _POSE}},
)


LOG = "log.mcap"
