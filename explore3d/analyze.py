"""The documented way to the job: `from explore3d.analyze import analyze`."""

from explore3d.jobs import analyze as analyze

__all__ = ["analyze"]
