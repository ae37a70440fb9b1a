"""The features in the log: its messages, and beside them a scene of base and features that viewers of MCAP draw.

Reference:
    foxglove.SceneUpdate, https://docs.foxglove.dev/docs/visualization/message-schemas/scene-update
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from explore3d import UserError
from explore3d.log import FRAME, Damage, intact_chunks
from mapping import Feature, Surface
from mapping.geometry.mesh import middle
from mapping.inference.kinds import kind_of
from mapping.model import SIZES, ObjectModel, feature_mesh, probability

FEATURES_TOPIC = "/features"
# Colour of the base: light, so that what lies on it stands out
_BASE_COLOUR = (0.78, 0.80, 0.83, 1.0)
_LABEL_COLOUR = (0.1, 0.1, 0.1, 1.0)
# Of lines and labels on the screen, whatever the zoom: the sizes of the report's pictures
_LINE_PIXELS, _LABEL_PIXELS = 3.0, 14.0
_ORIGIN = {"position": dict.fromkeys("xyz", 0.0), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
_LINE_STRIP = 0


def write_features_log(model: ObjectModel, log: Path | None, path: Path) -> Path:
    """Write an MCAP file with the messages of a log and, at its first time, the features as a scene.

    What is damaged in the log is left out. The samples are read from the new file as from the log itself.

    Args:
        model: what was found.
        log: where; None: the scene alone is written.
        path: the file to write; it appears whole.

    Raises:
        UserError: the log's first chunk, which names its channels, is destroyed; or the file cannot be written.
    """
    from mcap.exceptions import McapError

    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with draft.open("wb") as file:
            _write(model, log, file)
        os.replace(draft, path)
    except McapError as error:
        raise UserError(f"{log}: cannot be copied: {error}") from error
    except OSError as error:
        raise UserError(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        draft.unlink(missing_ok=True)
    return path


def _write(model: ObjectModel, log: Path | None, file: Any) -> None:
    from mcap.records import Channel, Message, Schema
    from mcap.writer import Writer

    writer = Writer(file)
    writer.start(profile="explore3d")
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    first, sequence = None, 0
    if log is not None:
        with log.open("rb") as source:
            for records in intact_chunks(source, Damage()):
                for record in records:
                    if isinstance(record, Schema) and record.id not in schemas:
                        schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                    elif isinstance(record, Channel) and record.id not in channels:
                        schema = schemas.get(record.schema_id, 0)
                        channels[record.id] = writer.register_channel(
                            record.topic, record.message_encoding, schema, record.metadata
                        )
                    elif isinstance(record, Message):
                        if record.channel_id not in channels:
                            raise UserError(f"{log}: the chunk that names its channels is destroyed")
                        first = record.log_time if first is None else first
                        sequence = record.sequence + 1
                        writer.add_message(
                            channels[record.channel_id],
                            record.log_time,
                            record.data,
                            record.publish_time,
                            record.sequence,
                        )
    stamp = 0 if first is None else first
    schema = writer.register_schema("foxglove.SceneUpdate", "jsonschema", json.dumps(SCENE_UPDATE_SCHEMA).encode())
    channel = writer.register_channel(FEATURES_TOPIC, "json", schema)
    scene = json.dumps(scene_update(model, stamp), allow_nan=False, ensure_ascii=False)
    writer.add_message(channel, stamp, scene.encode(), stamp, sequence)
    writer.finish()


def scene_update(model: ObjectModel, time_ns: int) -> dict[str, Any]:
    """The base and each feature (its body, its axis, its name and height) as a foxglove.SceneUpdate.

    Args:
        model: what was found; lengths in m, frame of the base.
        time_ns: from when on it is shown, ns; it stays until it is replaced.
    """
    entities = [_entity("base", time_ns, {"kind": model.base.kind}) | {"triangles": [_triangles(model.base.surface)]}]
    entities[0]["triangles"][0]["color"] = _colour(_BASE_COLOUR)
    for feature in model.features:
        colour = _colour(kind_of(feature).colour)
        drawn = _entity(feature.id, time_ns, _facts(feature))
        drawn["triangles"] = [_triangles(feature_mesh(feature)) | {"color": colour}]
        if len(feature.axis) > 1:
            drawn["lines"] = [_line(feature, colour)]
        drawn["texts"] = [_label(feature)]
        entities.append(drawn)
    return {"deletions": [], "entities": entities}


def _entity(name: str, time_ns: int, facts: dict[str, str]) -> dict[str, Any]:
    seconds, nanos = divmod(time_ns, 1_000_000_000)
    primitives = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": {"sec": seconds, "nsec": nanos},
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [{"key": key, "value": value} for key, value in facts.items()],
        **{primitive: [] for primitive in primitives},
    }


def _facts(feature: Feature) -> dict[str, str]:
    """What a click on the feature shows."""
    facts = {"kind": feature.kind} | {size: str(getattr(feature, size)) for size in SIZES}
    if (known := probability(feature)) is not None:
        facts["probability"] = f"{known:.6g}"
    return facts | ({"notes": "; ".join(feature.notes)} if feature.notes else {})


def _triangles(surface: Surface) -> dict[str, Any]:
    return {
        "pose": _ORIGIN,
        "points": _points(surface.vertices.tolist()),
        "colors": [],
        "indices": surface.faces.ravel().tolist(),
    }


def _line(feature: Feature, colour: dict[str, float]) -> dict[str, Any]:
    return {
        "type": _LINE_STRIP,
        "pose": _ORIGIN,
        "thickness": _LINE_PIXELS,
        "scale_invariant": True,
        "points": _points(feature.axis.tolist()),
        "color": colour,
        "colors": [],
        "indices": [],
    }


def _label(feature: Feature) -> dict[str, Any]:
    place = middle(feature.axis)[0].tolist()
    return {
        "pose": _ORIGIN | {"position": dict(zip("xyz", place, strict=True))},
        "billboard": True,
        "font_size": _LABEL_PIXELS,
        "scale_invariant": True,
        "color": _colour(_LABEL_COLOUR),
        "text": f"{feature.id}: {feature.height}",
    }


def _points(places: Sequence[Sequence[float]]) -> list[dict[str, float]]:
    return [dict(zip("xyz", place, strict=True)) for place in places]


def _colour(parts: Sequence[float]) -> dict[str, float]:
    return {name: float(part) for name, part in zip("rgba", parts, strict=True)}


def _record(title: str, **properties: Any) -> dict[str, Any]:
    return {"type": "object", "title": title, "properties": properties}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_NUMBER, _WHOLE, _TEXT, _YES = ({"type": name} for name in ("number", "integer", "string", "boolean"))
_VECTOR = _record("foxglove.Vector3", **dict.fromkeys("xyz", _NUMBER))
_POINT = _record("foxglove.Point3", **dict.fromkeys("xyz", _NUMBER))
_SHADE = _record("foxglove.Color", **dict.fromkeys("rgba", _NUMBER))
_POSE = _record(
    "foxglove.Pose", position=_VECTOR, orientation=_record("foxglove.Quaternion", **dict.fromkeys("xyzw", _NUMBER))
)
_MOMENT, _SPAN = (_record(title, sec=_WHOLE, nsec=_WHOLE) for title in ("time", "duration"))
_DRAWN = {"pose": _POSE, "points": _list(_POINT), "color": _SHADE, "colors": _list(_SHADE), "indices": _list(_WHOLE)}
# The parts of the message that are written here; viewers take it by its name and read these fields
SCENE_UPDATE_SCHEMA = _record(
    "foxglove.SceneUpdate",
    deletions=_list(_record("foxglove.SceneEntityDeletion", timestamp=_MOMENT, type=_WHOLE, id=_TEXT)),
    entities=_list(
        _record(
            "foxglove.SceneEntity",
            timestamp=_MOMENT,
            frame_id=_TEXT,
            id=_TEXT,
            lifetime=_SPAN,
            frame_locked=_YES,
            metadata=_list(_record("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)),
            **{
                name: _list(_record(f"foxglove.{title}Primitive"))
                for name, title in (
                    ("arrows", "Arrow"), ("cubes", "Cube"), ("spheres", "Sphere"), ("cylinders", "Cylinder"),
                    ("models", "Model"),
                )
            },
            lines=_list(
                _record("foxglove.LinePrimitive", type=_WHOLE, thickness=_NUMBER, scale_invariant=_YES, **_DRAWN)
            ),
            triangles=_list(_record("foxglove.TriangleListPrimitive", **_DRAWN)),
            texts=_list(
                _record(
                    "foxglove.TextPrimitive",
                    pose=_POSE, billboard=_YES, font_size=_NUMBER, scale_invariant=_YES, color=_SHADE, text=_TEXT,
                )
            ),
        )
    ),
)  # fmt: skip
