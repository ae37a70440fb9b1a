"""Surfaces and inference: arrays in, values out. It knows no machine, no file dialogue, no clock."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapping.base import Base
    from mapping.base_fit import fit_base
    from mapping.contact import BallContact
    from mapping.crossing import Crossing
    from mapping.curvature import Curvature
    from mapping.detectors import Detections, detect
    from mapping.envelope import estimate_surface
    from mapping.errors import MappingError
    from mapping.estimate import Estimate
    from mapping.feature import Feature, Interval
    from mapping.grammar import assemble
    from mapping.object_model import ObjectModel
    from mapping.posterior import Posterior
    from mapping.principal_curvatures import principal_curvatures
    from mapping.refine import refine, sample_posterior
    from mapping.surface import Surface
    from mapping.trace import Trace

# public name: where it lives; loaded when it is first asked for, so that importing the package stays light
_PUBLIC = {
    "Surface": "mapping.surface",
    "Trace": "mapping.trace",
    "Base": "mapping.base",
    "fit_base": "mapping.base_fit",
    "BallContact": "mapping.contact",
    "estimate_surface": "mapping.envelope",
    "Estimate": "mapping.estimate",
    "principal_curvatures": "mapping.principal_curvatures",
    "Curvature": "mapping.curvature",
    "detect": "mapping.detectors",
    "Detections": "mapping.detectors",
    "Crossing": "mapping.crossing",
    "assemble": "mapping.grammar",
    "sample_posterior": "mapping.refine",
    "refine": "mapping.refine",
    "Posterior": "mapping.posterior",
    "Feature": "mapping.feature",
    "Interval": "mapping.feature",
    "ObjectModel": "mapping.object_model",
    "MappingError": "mapping.errors",
}
__all__ = [
    "BallContact",
    "Base",
    "Crossing",
    "Curvature",
    "Detections",
    "Estimate",
    "Feature",
    "Interval",
    "MappingError",
    "ObjectModel",
    "Posterior",
    "Surface",
    "Trace",
    "assemble",
    "detect",
    "estimate_surface",
    "fit_base",
    "principal_curvatures",
    "refine",
    "sample_posterior",
]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'mapping' has no attribute {name!r}; its public names: {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
