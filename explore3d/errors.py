"""Errors that the application reports to its user in one line, with exit status 2."""


class UserError(ValueError):
    """Input that cannot be used; the message says what was asked, what was found, what is possible."""


class UnitError(UserError):
    """A quantity without a unit, with an unknown one, or with one of another dimension."""


class SceneError(UserError):
    """A scene file that cannot be read; names the file and the field."""


class MeshFileError(UserError):
    """A mesh file that is missing, empty, broken, or not a mesh; names the file."""


class FolderError(UserError):
    """An output folder that cannot be written."""


class EmptyLogError(UserError):
    """A log of ours without a sample."""


class PointCloudError(ValueError):
    """Bytes that are not a foxglove.PointCloud message."""
