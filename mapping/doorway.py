"""Doorway: a package hands out its public names, and loads each when it is first asked for."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any


class Doorway(ModuleType):
    """A package whose names live in the files below it; importing it loads none of them (PEP 562, as a class).

    A public name may read like the file that holds it (`detect` in `detect.py`): the import system hangs every loaded
    file under its package, and must not cover the name with it.
    """

    def __getattr__(self, name: str) -> Any:
        file = self.__dict__["_files"].get(name)
        if file is None:
            public = ", ".join(self.__dict__["__all__"])
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}; its public names: {public}")
        value = getattr(import_module(file), name)
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        if not (isinstance(value, ModuleType) and name in self.__dict__["_files"]):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*self.__dict__, *self.__dict__["__all__"]})


def doorway(package: str, public: Mapping[str, tuple[str, ...]]) -> None:
    """Make a package a doorway.

    Args:
        package: its name, `__name__`.
        public: {file below it, with dots between folders: the names that it gives}.
    """
    module = sys.modules[package]
    files = {name: f"{package}.{file}" for file, names in public.items() for name in names}
    module.__dict__.update(_files=files, __all__=sorted(files))
    module.__class__ = Doorway
