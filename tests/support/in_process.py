"""The program called in this process, as a user calls it: what it loads is loaded once for all tests."""

from __future__ import annotations

import sys

import pytest

from explore3d.cli.main import main


def explore3d_main(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Call the program with these arguments; its exit status."""
    monkeypatch.setattr(sys, "argv", ["explore3d", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0
