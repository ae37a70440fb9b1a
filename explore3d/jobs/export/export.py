"""export: what was found, in the forms of others; which one the name of the file says."""

from __future__ import annotations

import io
import json
from importlib.util import find_spec
from pathlib import Path

from explore3d import UserError
from explore3d.analysis import csv_text, residual
from explore3d.jobs import Told, analyze, belongs_to_session
from explore3d.jobs.export.crate import CRATE, crate
from explore3d.jobs.export.features_log import write_features_log
from explore3d.jobs.export.qif import qif_results
from explore3d.log import LOG
from mapping.geometry.mesh import write_whole
from mapping.inference.kinds import kind_of
from mapping.model import ObjectModel

CREST_COLUMNS = {
    "id": "string", "kind": "string", "vertex": "int64", "x": "float64", "y": "float64", "z": "float64",
    "nx": "float64", "ny": "float64", "nz": "float64", "height": "float64", "position_sd": "float64",
}  # fmt: skip
# Package that a form needs beside ours, and how to install it
FORMS = {
    ".csv": ("", ""),
    ".dxf": ("ezdxf", 'pip install "explore3d[cad]"'),
    ".qif": ("", ""),
    ".mcap": ("", ""),
    ".x3p": ("x3pio", 'pip install "explore3d[formats]"'),
}
# Drawings are in millimetres, as DXF's header says (INSUNITS 4)
_DXF_MILLIMETRES = 4


def export(source: Path | str, to: Path | str, told: Told | None = None, *, overwrite: bool = False) -> Path:
    """Write what was found in the form that the target's name asks for; returns its path.

    Args:
        source: a model (folder of a session, or model.json); for `.x3p` a log, or a session's folder with one.
        to: `.csv` or `.dxf`: the features' axes; `.qif`: the features and their sizes as measured results; `.mcap`:
            the session's log with the features in it, as viewers of MCAP draw them; `.x3p`: heights over the base,
            features left out; `ro-crate-metadata.json` in the session's folder: its files, versions and instrument.
        told: how to read a log.
        overwrite: replace a file that is there. The source, and what a session lists as its own, never is; the
            session's record is always made anew.

    Raises:
        UserError, ModelError: a source that does not hold it, a name that says no form, a package that is missing, a
            file that would be lost.
    """
    path = Path(to)
    may_be_written(source, path, overwrite=overwrite)
    if path.name == CRATE:
        return write_whole(path, json.dumps(crate(path.parent), indent=1, ensure_ascii=False) + "\n")
    if path.suffix == ".csv":
        return write_whole(path, crests_csv(ObjectModel.load(source)))
    if path.suffix == ".dxf":
        return write_whole(path, crests_dxf(ObjectModel.load(source)))
    if path.suffix == ".qif":
        return write_whole(path, qif_results(ObjectModel.load(source)))
    if path.suffix == ".mcap":
        log = _log_of(Path(source))
        return write_features_log(ObjectModel.load(source), log if log.is_file() else None, path)
    return write_whole(path, residual_x3p(source, told or Told()))


def may_be_written(source: Path | str, *targets: Path | str, overwrite: bool = False) -> None:
    """Refuse targets before the first of them is written.

    Args:
        source: what is exported.
        targets: as `to` of export.
        overwrite: files that are there may be replaced.

    Raises:
        UserError: a name that says no form or is given twice, a package or a folder that is missing, a file that
            would be lost.
    """
    paths = [Path(each) for each in targets]
    for path in paths:
        if paths.count(path) > 1:
            raise UserError(f"{path}: is given twice; give each target a name of its own")
        if path.name == CRATE:
            if path.parent.resolve() != Path(source).resolve():
                raise UserError(f"{path}: a record of {source} stands in that folder: {Path(source) / CRATE}")
            continue
        if path.suffix not in FORMS:
            names = ", ".join(f"NAME{suffix}" for suffix in FORMS)
            raise UserError(f"{path}: its name says no form; possible: {names}, {CRATE}")
        package, install = FORMS[path.suffix]
        if package and find_spec(package) is None:
            raise UserError(f"{path}: needs {package}, and nothing was written; install it: {install}")
        if not path.parent.is_dir():
            raise UserError(f"{path}: there is no folder {path.parent}; make it first")
        _nothing_lost(Path(source), path, overwrite)


def _log_of(source: Path) -> Path:
    return (source if source.is_dir() else source.parent) / LOG


def _nothing_lost(source: Path, path: Path, overwrite: bool) -> None:
    if not path.exists():
        return
    if path.is_dir():
        raise UserError(f"{path}: is a folder; give a file's name")
    if belongs_to_session(path) or any(read.exists() and path.samefile(read) for read in (source, _log_of(source))):
        raise UserError(f"{path}: belongs to what is exported, or to a session, and would be lost; give another name")
    if not overwrite:
        raise UserError(f"{path}: is there already; give another name, or --overwrite to replace it")


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
    import ezdxf

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
    import x3pio

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
