"""The draws of a model's posteriors as ArviZ reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from explore3d import UserError
from mapping.model import ObjectModel


def arviz_export(model: ObjectModel | Path | str) -> dict[str, Any]:
    """One arviz.InferenceData for each sampled feature, by the feature's id.

    Parameters keep their names and SI units (attribute `units`). The draws are nearly independent and form a single
    chain: convergence was judged on the whole ensemble, and its verdict is in the attributes (`status`, `tau`, ...).

    Args:
        model: a model, or the folder (or model.json) that it was saved in.

    Raises:
        UserError: ArviZ is not installed.
        ModelError: a model that cannot be read.
    """
    try:
        import arviz
    except ImportError as error:
        raise UserError("arviz_export needs ArviZ: python3 -m pip install 'explore3d[arviz]'") from error
    found = model if isinstance(model, ObjectModel) else ObjectModel.load(model)
    out = {}
    for feature in found.features:
        posterior = feature.posterior
        if posterior is None:
            continue
        draws = {name: posterior.draws(name)[None, :] for name in posterior.names}
        numbers = {name: getattr(posterior, name) for name in ("tau", "acceptance", "k_hat", "ess")}
        verdict = {"status": posterior.status, "reason": posterior.reason, "kind": feature.kind}
        data = arviz.from_dict(posterior=draws, posterior_attrs=numbers | verdict)
        for name, unit in zip(posterior.names, posterior.units, strict=True):
            data.posterior[name].attrs["units"] = unit
        out[feature.id] = data
    return out
