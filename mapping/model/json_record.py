"""The annotated model as JSON: records of features and back, schema "explore3d/model/1" (docs/model.md)."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np

from mapping import (
    KINDS,
    Anchor,
    Details,
    Dropped,
    Feature,
    FloatArray,
    Interval,
    LeftOut,
    ModelError,
    Posterior,
    Support,
)
from mapping.model.table import probability

# Names of the values under "extra" that have a type of their own
DETAILS = frozenset(each.name for each in fields(Details))

MODEL_SCHEMA = "explore3d/model/1"

Record = dict[str, Any]


def plain(value: Any, where: str = "value") -> Any:
    """The value in JSON's own types; numbers that are not finite become null.

    Raises:
        ModelError: something that JSON cannot hold, named by where it stands.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), where)
    if isinstance(value, int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    raise ModelError(f"{where} cannot be written as JSON: it is a {type(value).__name__}")


def feature_record(feature: Feature) -> Record:
    """One feature's record; its posterior draws are kept apart, under the feature's id."""
    return {
        "id": feature.id,
        "kind": feature.kind,
        "axis": plain(feature.axis),
        "normals": plain(feature.normals),
        "closed": feature.closed,
        "height": _interval_record(feature.height),
        "width": _interval_record(feature.width),
        "length": _interval_record(feature.length),
        "position_sd": plain(float(feature.position_sd)),
        "anchor": None if feature.anchor is None else _anchor_record(feature.anchor),
        "evidence": _evidence_record(feature),
        "curvature_feature": bool(feature.curvature_feature),
        "posterior": None if feature.posterior is None else _posterior_record(feature.posterior),
        "notes": list(feature.notes),
        "extra": plain({**feature.extra, **feature.details.known()}, f"feature {feature.id}: extra"),
    }


def read_feature(record: Record, draws: FloatArray | None) -> Feature:
    """The feature that a record describes; `draws` (S, P) are its posterior's samples.

    Raises:
        ModelError: a field is missing or of the wrong form.
    """
    name = record.get("id", "without id")
    try:
        if record["kind"] not in KINDS:
            raise ModelError(f"feature {name}: unknown kind {record['kind']!r}; possible: {', '.join(KINDS)}")
        return Feature(
            kind=record["kind"],
            axis=_rows(record["axis"]),
            normals=_rows(record["normals"]),
            height=_read_interval(record["height"]),
            width=_read_interval(record["width"]),
            length=_read_interval(record["length"]),
            evidence=_read_evidence(record["evidence"]),
            curvature_feature=bool(record["curvature_feature"]),
            position_sd=_number(record["position_sd"]),
            posterior=_read_posterior(record["posterior"], draws),
            anchor=_read_anchor(record["anchor"]),
            id=record["id"],
            notes=tuple(record["notes"]),
            extra={name: value for name, value in record["extra"].items() if name not in DETAILS},
            details=Details.read(record["extra"]),
        )
    except KeyError as error:
        raise ModelError(f"feature {name}: field {error.args[0]!r} is missing") from error
    except (TypeError, AttributeError) as error:
        raise ModelError(f"feature {name}: {error}") from error


def left_out_record(left_out: LeftOut) -> Record:
    """One stage that was left out, as a record."""
    return {"stage": left_out.stage, "reason": left_out.reason, "saved": left_out.saved}


def dropped_record(dropped: Dropped) -> Record:
    """One detection that is no feature, as a record."""
    return {each.name: plain(getattr(dropped, each.name), f"dropped.{each.name}") for each in fields(Dropped)}


def read_dropped(record: Record) -> Dropped:
    """The detection that a record describes.

    Raises:
        TypeError: a field is missing, or unknown.
    """
    known = Dropped(**record)
    point = np.array(known.point, dtype=np.float64)
    return replace(known, point=point, height=_number(known.height), snr=_number(known.snr))


def _interval_record(interval: Interval) -> Record:
    record = {name: plain(float(getattr(interval, name))) for name in ("median", "low", "high")}
    return record | {name: True for name in ("censored", "bounded") if getattr(interval, name)}


def _read_interval(record: Record) -> Interval:
    median, low, high = (_number(record[name]) for name in ("median", "low", "high"))
    return Interval(median, low, high, bool(record.get("censored", False)), bool(record.get("bounded", False)))


def _anchor_record(anchor: Anchor) -> Record:
    names = ("barycentric", "position", "frame")
    return {"face": int(anchor.face)} | {name: plain(getattr(anchor, name)) for name in names}


def _read_anchor(record: Record | None) -> Anchor | None:
    if record is None:
        return None
    parts = {name: np.array(record[name], dtype=np.float64) for name in ("barycentric", "position", "frame")}
    return Anchor(face=int(record["face"]), **parts)


def _evidence_record(feature: Feature) -> Record:
    evidence = feature.evidence
    return {
        "snr": plain(float(evidence.snr)),
        "crossings": int(evidence.crossings),
        "algorithms": [int(number) for number in evidence.algorithms],
        "log_odds": None if evidence.log_odds is None else plain(float(evidence.log_odds)),
        "probability": plain(probability(feature)),
    }


def _read_evidence(record: Record) -> Support:
    odds = record["log_odds"]
    return Support(
        snr=_number(record["snr"]),
        crossings=int(record["crossings"]),
        algorithms=tuple(record["algorithms"]),
        log_odds=None if odds is None else float(odds),
    )


def _posterior_record(posterior: Posterior) -> Record:
    summary = {
        name: _interval_record(Interval.from_draws(posterior.samples[:, i])) | {"unit": unit}
        for i, (name, unit) in enumerate(zip(posterior.names, posterior.units, strict=True))
        if len(posterior.samples)
    }
    numbers = {name: plain(float(getattr(posterior, name))) for name in ("tau", "acceptance", "k_hat", "ess")}
    return {
        "names": list(posterior.names),
        "units": list(posterior.units),
        "status": posterior.status,
        "reason": posterior.reason,
        "draws": len(posterior.samples),
        **numbers,
        "summary": summary,
    }


def _read_posterior(record: Record | None, draws: FloatArray | None) -> Posterior | None:
    if record is None:
        return None
    names = tuple(record["names"])
    samples = np.zeros((0, len(names))) if draws is None else draws
    if samples.shape != (record["draws"], len(names)):
        raise ModelError(
            f"posterior draws have shape {samples.shape}; the record promises {(record['draws'], len(names))}"
        )
    numbers = {name: _number(record[name]) for name in ("tau", "acceptance", "k_hat", "ess")}
    return Posterior(
        names, tuple(record["units"]), samples, status=record["status"], reason=record["reason"], **numbers
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _rows(values: list[list[float]]) -> FloatArray:
    return np.array(values, dtype=np.float64).reshape(-1, 3)
