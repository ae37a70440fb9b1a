"""A model's features as a table: rows of values for programs, or text for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

from mapping import Dropped, Feature, ModelError
from mapping.geometry.mesh import middle
from mapping.inference.configuration import share_as_told

SIZES = ("height", "width", "length")


def rows(features: Sequence[Feature]) -> list[dict[str, Any]]:
    """One row a feature, SI units: its place is the middle of its axis, the limits of its sizes hold 90 %."""
    return [_row(feature) for feature in features]


def _row(feature: Feature) -> dict[str, Any]:
    row: dict[str, Any] = {"id": feature.id, "kind": feature.kind}
    row |= {name: float(value) for name, value in zip("xyz", middle(feature.axis)[0], strict=True)}
    for name in SIZES:
        size = getattr(feature, name)
        row |= {
            name: size.median,
            f"{name}_low": size.low,
            f"{name}_high": size.high,
            f"{name}_censored": size.censored,
            f"{name}_bounded": size.bounded,
        }
    support = feature.evidence
    return row | {
        "position_sd": float(feature.position_sd),
        "snr": float(support.snr),
        "crossings": support.crossings,
        "log_odds": support.log_odds,
        "probability": probability(feature),
        "finer_than_the_tip": feature.curvature_feature,
        "face": None if feature.anchor is None else feature.anchor.face,
    }


def probability(of: Feature | Dropped) -> float | None:
    """That it is there, against nothing and with even odds beforehand; None where nobody asked.

    Of a feature, that it is there as it is told: where the trace does not decide how many are felt together, what is
    there in one number only is as probable as that number.
    """
    odds = of.evidence.log_odds if isinstance(of, Feature) else of.log_odds
    if odds is None:
        return None
    return 0.5 * (1.0 + math.tanh(0.5 * odds)) * (share_as_told(of) if isinstance(of, Feature) else 1.0)


def dataframe(features: Sequence[Feature]) -> Any:
    """`rows` as a pandas.DataFrame.

    Raises:
        ModelError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise ModelError("a data frame needs pandas, which is not installed: pip install explore3d[pandas]") from error
    return pd.DataFrame(rows(features))


def html_table(features: Sequence[Feature]) -> str:
    """The features as an HTML table, for notebooks."""
    head = "".join(f"<th>{name}</th>" for name in ("feature", *SIZES, "notes"))
    body = "".join(
        f"<tr><td>{escape(each.id)}</td>"
        + "".join(f"<td>{escape(str(getattr(each, name)))}</td>" for name in SIZES)
        + f"<td>{escape('; '.join(each.notes))}</td></tr>"
        for each in features
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
