"""Errors of the mapping package: bad input, named by what was asked, found and possible."""


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
