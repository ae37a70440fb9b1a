"""Surfaces and inference: arrays in, values out. It knows no machine, no file dialogue, no clock.

"The paper" in all modules is A. M. Okamura and M. R. Cutkosky, Haptic exploration of fine surface features, ICRA 1999;
"theory" is docs/theory.md, where the references stand in full.
"""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.arrays import (
        BoolArray as BoolArray,
        ComplexArray as ComplexArray,
        FloatArray as FloatArray,
        IntArray as IntArray,
        ShortArray as ShortArray,
        dots as dots,
        lengths as lengths,
        read_only as read_only,
        sides_of_box as sides_of_box,
    )
    from mapping.assembly.assemble import assemble as assemble
    from mapping.base.base import Base as Base
    from mapping.base.fit import fit_base as fit_base
    from mapping.detection.crossing import Crossing as Crossing
    from mapping.detection.detect import Detections as Detections, detect as detect
    from mapping.errors import (
        UNKNOWN_TEXT as UNKNOWN_TEXT,
        CalibrationError as CalibrationError,
        ContactError as ContactError,
        CourseError as CourseError,
        CurvatureError as CurvatureError,
        DetectionError as DetectionError,
        EmptyWindowError as EmptyWindowError,
        EnvelopeError as EnvelopeError,
        FormError as FormError,
        MappingError as MappingError,
        ModelError as ModelError,
        NoiseError as NoiseError,
        Open3DError as Open3DError,
        ParallelError as ParallelError,
        SamplerError as SamplerError,
        ShapeError as ShapeError,
        SurfaceError as SurfaceError,
        SweepMeshError as SweepMeshError,
        TraceError as TraceError,
    )
    from mapping.estimate.envelope.envelope import estimate_surface as estimate_surface
    from mapping.estimate.envelope.estimate import Estimate as Estimate
    from mapping.feature import (
        Anchor as Anchor,
        Details as Details,
        Dropped as Dropped,
        Feature as Feature,
        Interval as Interval,
        LeftOut as LeftOut,
        Support as Support,
        length_text as length_text,
        length_unit as length_unit,
        place_decimals as place_decimals,
        place_text as place_text,
    )
    from mapping.geometry.contact.first_contact import BallContact as BallContact
    from mapping.geometry.contact.interference_points import interference_points as interference_points
    from mapping.geometry.contact.parallel_surface import (
        ParallelSurface as ParallelSurface,
        parallel_surface as parallel_surface,
    )
    from mapping.geometry.curvature.curvature import Curvature as Curvature
    from mapping.geometry.curvature.principal_curvatures import principal_curvatures as principal_curvatures
    from mapping.inference.feature_posterior import refine as refine, sample_posterior as sample_posterior
    from mapping.inference.kinds.kind import KINDS as KINDS
    from mapping.model.object_model import ObjectModel as ObjectModel
    from mapping.posterior import Posterior as Posterior
    from mapping.surface import Surface as Surface
    from mapping.trace import Trace as Trace

_PUBLIC = {
    "arrays": (
        "BoolArray",
        "ComplexArray",
        "FloatArray",
        "IntArray",
        "ShortArray",
        "dots",
        "lengths",
        "read_only",
        "sides_of_box",
    ),
    "assembly.assemble": ("assemble",),
    "base.base": ("Base",),
    "base.fit": ("fit_base",),
    "detection.crossing": ("Crossing",),
    "detection.detect": ("Detections", "detect"),
    "errors": (
        "UNKNOWN_TEXT",
        "CalibrationError",
        "ContactError",
        "CourseError",
        "FormError",
        "CurvatureError",
        "DetectionError",
        "EmptyWindowError",
        "EnvelopeError",
        "MappingError",
        "ModelError",
        "NoiseError",
        "Open3DError",
        "ParallelError",
        "SamplerError",
        "ShapeError",
        "SurfaceError",
        "SweepMeshError",
        "TraceError",
    ),
    "estimate.envelope.envelope": ("estimate_surface",),
    "estimate.envelope.estimate": ("Estimate",),
    "feature": (
        "Anchor",
        "Details",
        "Dropped",
        "Feature",
        "Interval",
        "LeftOut",
        "Support",
        "length_text",
        "place_decimals",
        "place_text",
        "length_unit",
    ),
    "geometry.contact.first_contact": ("BallContact",),
    "geometry.contact.interference_points": ("interference_points",),
    "geometry.contact.parallel_surface": ("ParallelSurface", "parallel_surface"),
    "geometry.curvature.curvature": ("Curvature",),
    "geometry.curvature.principal_curvatures": ("principal_curvatures",),
    "inference.feature_posterior": ("refine", "sample_posterior"),
    "inference.kinds.kind": ("KINDS",),
    "model.object_model": ("ObjectModel",),
    "posterior": ("Posterior",),
    "surface": ("Surface",),
    "trace": ("Trace",),
}
doorway(__name__, _PUBLIC)
