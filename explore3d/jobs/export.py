"""export: what was found, in the forms of others: crest lines (CSV, DXF), the residual (X3P), a session's record."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from explore3d import UserError, __version__
from explore3d.analysis import csv_text, residual
from explore3d.jobs.analyze import Told, analyze
from explore3d.jobs.session import MARKER
from mapping.geometry.mesh import write_whole
from mapping.inference.kinds import kind_of
from mapping.model import ObjectModel

CRATE = "ro-crate-metadata.json"
CRATE_CONTEXT = "https://w3id.org/ro/crate/1.1/context"
CREST_COLUMNS = {
    "id": "string", "kind": "string", "vertex": "int64", "x": "float64", "y": "float64", "z": "float64",
    "nx": "float64", "ny": "float64", "nz": "float64", "height": "float64", "position_sd": "float64",
}  # fmt: skip
# Drawings are in millimetres, as DXF's header says (INSUNITS 4)
_DXF_MILLIMETRES = 4
MEDIA_TYPES = {
    ".json": "application/json", ".csv": "text/csv", ".html": "text/html", ".glb": "model/gltf-binary",
    ".parquet": "application/vnd.apache.parquet", ".toml": "application/toml", ".svg": "image/svg+xml",
    ".mcap": "application/octet-stream", ".npz": "application/octet-stream",
}  # fmt: skip


def export(source: Path | str, to: Path | str, told: Told | None = None) -> Path:
    """Write what was found in the form that the target's name asks for; returns its path.

    Args:
        source: a model (folder of a session, or model.json); for `.x3p` a log, or a session's folder with one.
        to: `.csv` or `.dxf`: the features' axes; `.x3p`: heights over the base, features left out;
            `ro-crate-metadata.json` in the session's folder: its files, versions and instrument.
        told: how to read a log.

    Raises:
        UserError, ModelError: a source that does not hold it, a name that says no form, a package that is missing.
    """
    path = Path(to)
    if path.name == CRATE:
        if path.parent.resolve() != Path(source).resolve():
            raise UserError(f"{path}: a record of {source} stands in that folder: {Path(source) / CRATE}")
        return write_whole(path, json.dumps(crate(path.parent), indent=1, ensure_ascii=False) + "\n")
    if path.suffix == ".csv":
        return write_whole(path, crests_csv(ObjectModel.load(source)))
    if path.suffix == ".dxf":
        return write_whole(path, crests_dxf(ObjectModel.load(source)))
    if path.suffix == ".x3p":
        return write_whole(path, residual_x3p(source, told or Told()))
    raise UserError(f"{path}: its name says no form; possible: NAME.csv, NAME.dxf, NAME.x3p, {CRATE}")


def crests_csv(model: ObjectModel) -> str:
    """The vertices of all axes as a table: one row a vertex, one feature after the other; m."""
    rows = [
        dict(zip(CREST_COLUMNS, (each.id, each.kind, number, *map(float, place), *map(float, normal)), strict=False))
        | {"height": each.height.median, "position_sd": float(each.position_sd)}
        for each in model.features
        for number, (place, normal) in enumerate(zip(each.axis, each.normals, strict=True), 1)
    ]
    return csv_text(CREST_COLUMNS, rows)


def crests_dxf(model: ObjectModel) -> bytes:
    """A drawing in mm: lines as 3D polylines, points as points, a layer for each kind; sizes as extended data."""
    try:
        import ezdxf
    except ImportError as error:
        raise UserError('a drawing needs ezdxf; install it: pip install "explore3d[cad]"') from error
    drawing = ezdxf.new("R2010", units=_DXF_MILLIMETRES)
    drawing.appids.new("EXPLORE3D")
    space = drawing.modelspace()
    for feature in model.features:
        layer = feature.kind.upper().replace(" ", "_")
        if layer not in drawing.layers:
            red, green, blue = (round(255 * part) for part in kind_of(feature).colour[:3])
            drawing.layers.add(layer, true_color=ezdxf.colors.rgb2int((red, green, blue)))
        points, about = [tuple(point) for point in 1e3 * feature.axis], {"layer": layer}
        entity = (
            space.add_point(points[0], dxfattribs=about)
            if len(points) == 1
            else space.add_polyline3d(points, dxfattribs=about)
        )
        sizes = [1e3 * getattr(feature, name).median for name in ("height", "width", "length")]
        entity.set_xdata("EXPLORE3D", [(1000, feature.id), *((1040, size) for size in sizes)])
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode()


def residual_x3p(source: Path | str, told: Told) -> bytes:
    """Heights over the base beside the features, of a profile or a raster, by ISO 25178-72."""
    try:
        import x3pio
    except ImportError as error:
        raise UserError('X3P needs x3pio; install it: pip install "explore3d[formats]"') from error
    analysis = analyze(
        [source], tip_radius=told.tip_radius, model=told.model, model_units=told.model_units, quick=True, **told.table
    )
    heights, spacing = residual(analysis.trace, analysis.base, analysis.model.features)
    stream = io.BytesIO()
    row, column = spacing
    if heights.ndim == 1:
        x3pio.write(stream, heights, x_scale=column)
    else:
        x3pio.write(stream, heights, x_scale=column, y_scale=row)
    return stream.getvalue()


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
