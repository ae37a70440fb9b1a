"""ObjectModel: the global model with its fine features attached, and its folder on disk."""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self
from zipfile import BadZipFile

import numpy as np

from mapping import Dropped, Feature, FloatArray, LeftOut, ModelError, Surface
from mapping.base import Base, anchor
from mapping.geometry.mesh import write_whole
from mapping.model.glb import glb_bytes
from mapping.model.json_record import (
    MODEL_SCHEMA,
    Record,
    dropped_record,
    feature_record,
    left_out_record,
    plain,
    read_dropped,
    read_feature,
)
from mapping.model.plot import plot_model, plot_profile
from mapping.model.table import dataframe, html_table

__all__ = ["LeftOut", "ObjectModel"]


# Fields over the base's vertices or faces that are kept beside it
FIELDS = ("reach", "below", "above", "sigma", "inspected", "deviation")


@dataclass(frozen=True, eq=False, repr=False)
class ObjectModel:
    """A body: its base, and what the finger found on it. `model["ridge-1"]` is the feature of that id.

    Args:
        base: the global model.
        features: the features, each with an id and an anchor (see `attach`).
        left_out: stages that were not needed or could not be done.
        timings: seconds spent per stage.
        provenance: where it came from (scene, tip radius, log hash, software version); JSON values.
        reach: (V,) label of each base vertex (0 touched, 1 bridged, 2 extrapolated), or None.
        below, above: (V,) what is proven of the estimated surface at each vertex: how far under it the body may be, how
            far over it it may stand out, m; infinite where nothing is proven; or None.
        sigma: (V,) standard deviation of the base at each vertex, m, or None.
        inspected: (F,) height above which each base face is free of features that were not found, m, or None.
        deviation: (V,) by how much the body stands off the model that was given, at each vertex, m, or None.
        dropped: what was detected and is no feature.
    """

    base: Base
    features: tuple[Feature, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    reach: FloatArray | None = None
    below: FloatArray | None = None
    above: FloatArray | None = None
    sigma: FloatArray | None = None
    inspected: FloatArray | None = None
    deviation: FloatArray | None = None
    dropped: tuple[Dropped, ...] = ()

    @classmethod
    def attach(cls, base: Base, features: Sequence[Feature], **about: Any) -> Self:
        """The model of a base with features hung on it: each gets an anchor and an id ("ridge-1", ...).

        Args:
            base: the global model.
            features: features whose axes run on the base, in the order of their numbers.
            about: the other fields of the model.
        """
        number: Counter[str] = Counter()
        attached = []
        for feature in features:
            number[feature.kind] += 1
            name = f"{feature.kind.replace(' ', '-')}-{number[feature.kind]}"
            attached.append(replace(feature, id=name, anchor=anchor(feature.axis, base.surface)))
        return cls(base, tuple(attached), **about)

    def __repr__(self) -> str:
        names = ", ".join(feature.id for feature in self.features) or "no features"
        return f"<ObjectModel: {self.base.kind} base of {len(self.base.surface.faces)} faces; {names}>"

    def _repr_html_(self) -> str:
        return html_table(self.features)

    def __getitem__(self, name: str) -> Feature:
        for feature in self.features:
            if feature.id == name:
                return feature
        raise KeyError(f"no feature {name!r}; possible: {', '.join(each.id for each in self.features) or 'none'}")

    def __contains__(self, name: object) -> bool:
        """True of the name of a feature, as for `model[name]`, and of a feature itself."""
        return any(name == feature.id or name is feature for feature in self.features)

    def __iter__(self) -> Iterator[Feature]:
        return iter(self.features)

    def __len__(self) -> int:
        return len(self.features)

    def __bool__(self) -> bool:
        return True

    def to_dataframe(self) -> Any:
        """A pandas.DataFrame with a row for each feature (SI units): id, kind, place, sizes with their 90 % limits.

        Raises:
            ModelError: pandas is not installed.
        """
        return dataframe(self.features)

    def plot(self, axes: Any = None) -> Any:
        """Draw the base and its features with matplotlib; of a profile the features' heights along it.

        Args:
            axes: of matplotlib, with projection "3d" unless it is a profile, to draw into; None: new ones.

        Returns:
            The axes.
        """
        if self.base.kind == "profile":
            return plot_profile(self.features, axes)
        return plot_model(self.base.surface, self.features, axes)

    def save(self, folder: Path | str) -> Path:
        """Write model.npz (arrays), model.glb (for viewers) and, last, model.json; returns its path.

        Raises:
            ModelError: a feature without an id or with one used twice, or values that JSON cannot hold.
            OSError: the folder cannot be made or written.
        """
        self._check_ids()
        document = json.dumps(self.document(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        proven = {"_BELOW": self.below, "_ABOVE": self.above}
        glb = glb_bytes(self.base.surface, self.features, self.reach, self.sigma, self.deviation, proven)
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        write_whole(place / "model.npz", self._arrays())
        write_whole(place / "model.glb", glb)
        return write_whole(place / "model.json", document)

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """The model saved in a folder (or at its model.json).

        Raises:
            ModelError: no model there, another schema, or a field missing or malformed.
        """
        file = Path(path) / "model.json" if Path(path).is_dir() else Path(path)
        record, arrays = _read(file)
        try:
            surface = Surface(arrays["base_vertices"], arrays["base_faces"])
            base = Base.read(surface, record["base"]["kind"], record["base"]["parameters"])
            return cls(
                base,
                tuple(read_feature(each, arrays.get(f"draws/{each.get('id')}")) for each in record["features"]),
                tuple(LeftOut(**each) for each in record["left_out"]),
                {name: float(seconds) for name, seconds in record["timings"].items()},
                record["provenance"],
                **{name: arrays.get(name) for name in FIELDS},
                dropped=tuple(read_dropped(each) for each in record.get("dropped", [])),
            )
        except KeyError as error:
            raise ModelError(f"{file}: field {error.args[0]!r} is missing") from error
        except (TypeError, AttributeError) as error:
            raise ModelError(f"{file}: {error}") from error

    def document(self) -> Record:
        """The content of model.json: plain JSON values, SI units (docs/model.md)."""
        surface = self.base.surface
        stopped = self.provenance.get("stopped")  # what came of an exploration that ended early says so first
        return ({"stopped": stopped} if stopped else {}) | {
            "schema": MODEL_SCHEMA,
            "units": "m",
            "base": {
                "kind": self.base.kind,
                "parameters": plain(self.base.record(), "base.parameters"),
                "mesh": {"file": "model.glb", "node": "base"},
                "arrays": "model.npz",
                "vertices": len(surface.vertices),
                "faces": len(surface.faces),
                "bounds": plain(surface.bounds),
            },
            "features": [feature_record(feature) for feature in self.features],
            "left_out": [left_out_record(each) for each in self.left_out],
            "dropped": [dropped_record(each) for each in self.dropped],
            "timings": {name: round(float(seconds), 6) for name, seconds in self.timings.items()},
            "provenance": plain(self.provenance, "provenance"),
        }

    def _check_ids(self) -> None:
        ids = Counter(feature.id for feature in self.features)
        twice = [name for name, count in ids.items() if count > 1]
        if "" in ids or twice:
            found = f"{twice[0]!r} used {ids[twice[0]]} times" if twice and twice[0] else "a feature without one"
            raise ModelError(f"a model's features need ids of their own (use ObjectModel.attach); found {found}")

    def _arrays(self) -> bytes:
        arrays: dict[str, Any] = {
            "base_vertices": self.base.surface.vertices,
            "base_faces": self.base.surface.faces,
        }
        arrays |= {f"draws/{each.id}": each.posterior.samples for each in self.features if each.posterior is not None}
        arrays |= {name: getattr(self, name) for name in FIELDS if getattr(self, name) is not None}
        stream = io.BytesIO()
        np.savez_compressed(stream, **arrays)
        return stream.getvalue()


def _read(file: Path) -> tuple[Record, dict[str, FloatArray]]:
    """The JSON document and the arrays of a saved model."""
    try:
        record = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"{file} is not a readable model: {_why(error)}") from error
    if not isinstance(record, dict) or record.get("schema") != MODEL_SCHEMA:
        found = record.get("schema") if isinstance(record, dict) else type(record).__name__
        raise ModelError(f"{file}: expected schema {MODEL_SCHEMA!r}, found {found!r}")
    arrays = file.parent / "model.npz"
    try:
        with np.load(arrays, allow_pickle=False) as bundle:
            return record, dict(bundle)
    except (OSError, ValueError, BadZipFile) as error:
        raise ModelError(f"{arrays}, which holds the arrays of {file.name}, cannot be read: {_why(error)}") from error


def _why(error: Exception) -> str:
    """The error in words, without its number and the file that the message names already."""
    return str(getattr(error, "strerror", None) or error)
