"""load: the annotated model that a job left."""

from __future__ import annotations

from pathlib import Path

from mapping import ObjectModel


def load(path: Path | str) -> ObjectModel:
    """The annotated model of a session's folder, or of its model.json.

    Raises:
        ModelError: there is none, or one that cannot be read.
    """
    return ObjectModel.load(path)
