"""A scene written as TOML: the standard library reads TOML but does not write it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def scene_text(tables: Mapping[str, Any], name: str = "") -> str:
    """TOML of nested mappings of strings, booleans, finite numbers, lists, and lists of mappings."""
    lines = [f"{key} = {_value(value)}" for key, value in tables.items() if not _is_table(value)]
    for key, value in tables.items():
        full = f"{name}.{key}" if name else key
        if isinstance(value, Mapping):
            lines.append(f"\n[{full}]\n{scene_text(value, full)}".rstrip("\n"))
        elif _is_table(value):
            lines += [f"\n[[{full}]]\n{scene_text(entry, full)}".rstrip("\n") for entry in value]
    return "\n".join(lines) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _value(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    # JSON's strings, numbers, true and false are TOML's as well; DEL is the one character that is not
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
