"""Errors of the mapping package: bad input, named by what was asked, found and possible; and what is not known."""

# Written where a value is not known
UNKNOWN_TEXT = "–"


class MappingError(ValueError):
    """Base of every error that mapping raises for input it cannot use."""


class SurfaceError(MappingError):
    """A mesh that is empty, malformed, or not finite."""


class TraceError(MappingError):
    """A trace that is empty, malformed, or not finite."""


class ModelError(MappingError):
    """An annotated model that cannot be written or read: which field, and why."""


class ContactError(MappingError):
    """A contact query with an impossible ball, start or direction."""


class FormError(MappingError):
    """A form of a base that there is not, or that does not fit the trace."""


class SamplerError(MappingError):
    """emcee did not take the state it was given."""


class SweepMeshError(MappingError):
    """Points that do not make a mesh."""


class CalibrationError(MappingError):
    """Samples that do not determine the tip."""


class EnvelopeError(MappingError):
    """A trace from which no surface can be estimated as asked."""


class EmptyWindowError(MappingError):
    """No sample of the trace is near the feature."""


class CourseError(EmptyWindowError):
    """The axis does not lie over the base, turns back on itself or has no length: no trace tells of it."""


class CurvatureError(MappingError):
    """Points whose curvature cannot be asked for."""


class DetectionError(MappingError):
    """Detection asked for something that does not exist or cannot be."""


class Open3DError(MappingError, ImportError):
    """Open3D or a system library that it needs cannot be loaded."""


class ShapeError(MappingError):
    """A size that no shape can have."""


class NoiseError(MappingError):
    """Noise parameters or residuals that cannot describe a noise."""


class ParallelError(MappingError):
    """Normals or curvatures that do not fit a surface."""
