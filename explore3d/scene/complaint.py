"""What is wrong with a scene, in one line: the field, what was found, what is possible."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError


def complaint(error: ValidationError, root: type[BaseModel], name: str = "") -> str:
    """One line about the first mistake (unknown keys first: they explain missing ones), and how many more.

    Args:
        name: of the table that `root` is the class of; "" for the whole file.
    """
    mistakes = sorted(error.errors(), key=lambda mistake: mistake["type"] != "extra_forbidden")
    first = mistakes[0]
    field = f"{name}.{_field_name(first['loc'])}".strip(".")
    others = len({_field_name(mistake["loc"]) for mistake in mistakes}) - 1
    more = f" (and {others} more)" if others else ""
    return f"{field}: {_reason(first, root)}{more}" if field else f"{_reason(first, root)}{more}"


def _field_name(place: tuple[int | str, ...]) -> str:
    """tip.radius, truth[2].axis[0][1]; what pydantic calls the alternatives of a union ("dict[...]") is left out."""
    name = ""
    for part in place:
        if isinstance(part, str) and "[" in part:
            continue
        name += f"[{part}]" if isinstance(part, int) else f".{part}"
    return name.removeprefix(".")


def _reason(mistake: Any, root: type[BaseModel]) -> str:
    kind, found = mistake["type"], mistake["input"]
    if kind == "extra_forbidden":
        return _unknown_key(mistake["loc"], root)
    if kind == "missing":
        return "missing; it must be given"
    if kind == "value_error":
        return str(mistake["ctx"]["error"])
    message = mistake["msg"].removeprefix("Input ")
    return f"{message[:1].lower()}{message[1:]}; found {_short(found)}"


def _unknown_key(place: tuple[int | str, ...], root: type[BaseModel]) -> str:
    known = _keys(_table(place[:-1], root))
    near = get_close_matches(str(place[-1]), known, n=1, cutoff=0.0)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"unknown key; {hint}possible: {', '.join(known)}"


def _keys(table: type[BaseModel]) -> list[str]:
    return [info.alias or name for name, info in table.model_fields.items()]


def _table(place: tuple[int | str, ...], root: type[BaseModel]) -> type[BaseModel]:
    """The class of the table at a place: its annotation, or the BaseModel within Optional or tuple."""
    table = root
    for part in place:
        if isinstance(part, str):
            annotation = table.model_fields[part].annotation
            candidates = [annotation, *get_args(annotation)]
            table = next(c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel))
    return table


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
