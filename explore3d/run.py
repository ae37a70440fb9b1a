"""The documented way to the job: `from explore3d.run import run`."""

from explore3d.jobs import run as run

__all__ = ["run"]
