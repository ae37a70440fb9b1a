"""A session's record as RO-Crate metadata: its files with their digests, and how they came about."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from explore3d import UserError, __version__
from explore3d.jobs import MARKER

CRATE = "ro-crate-metadata.json"
CRATE_CONTEXT = "https://w3id.org/ro/crate/1.1/context"
MEDIA_TYPES = {
    ".json": "application/json", ".csv": "text/csv", ".html": "text/html", ".glb": "model/gltf-binary",
    ".parquet": "application/vnd.apache.parquet", ".toml": "application/toml", ".svg": "image/svg+xml",
    ".mcap": "application/octet-stream", ".npz": "application/octet-stream",
}  # fmt: skip


def crate(folder: Path) -> dict[str, Any]:
    """The RO-Crate 1.1 metadata of a session's folder: its files with their digests, and how they came about.

    Raises:
        UserError: the folder holds no session that is whole.
    """
    try:
        session = json.loads((folder / MARKER).read_text("utf-8"))
        about: Mapping[str, Any] = json.loads((folder / "model.json").read_text("utf-8"))["provenance"]
        names = [str(name) for name in session["files"] if name != CRATE]
        files = [_file(folder, name) for name in names]
        finished, job = session["finished"], session["job"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"{folder}: is no session with a model that is whole: {error}") from error
    program = {
        "@id": "#explore3d",
        "@type": "SoftwareApplication",
        "name": "explore3d",
        "softwareVersion": __version__ if about.get("software") is None else str(about["software"]).rpartition(" ")[2],
    }
    tip = {
        "@id": "#fingertip",
        "@type": "PropertyValue",
        "name": "radius of the fingertip",
        "value": about.get("tip_radius"),
        "unitCode": "MTR",
    }
    recording: dict[str, Any] = {
        "@id": f"#sha256-{about.get('log_sha256')}",
        "@type": "CreativeWork",
        "name": "the recording",
    }
    recording |= {"sha256": about.get("log_sha256")}
    recording |= {"description": "; ".join(map(str, about.get("read_as") or []))}
    action = {
        "@id": "#analysis",
        "@type": "CreateAction",
        "name": f"explore3d {job}",
        "endTime": finished,
        "instrument": [{"@id": "#explore3d"}, {"@id": "#fingertip"}],
        "object": {"@id": recording["@id"]},
        "result": [{"@id": each["@id"]} for each in files],
    }
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": str(about.get("scene") or folder.resolve().name),
        "description": "Fine surface features that a round fingertip found, with their uncertainties",
        "datePublished": finished,
        "hasPart": [{"@id": each["@id"]} for each in files],
        "mentions": {"@id": "#analysis"},
    }
    own = {
        "@id": CRATE,
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    return {"@context": CRATE_CONTEXT, "@graph": [own, root, *files, program, tip, recording, action]}


def _file(folder: Path, name: str) -> dict[str, Any]:
    content = (folder / name).read_bytes()
    return {
        "@id": name,
        "@type": "File",
        "name": name,
        "contentSize": str(len(content)),
        "encodingFormat": MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream"),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
