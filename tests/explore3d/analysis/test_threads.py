"""An analysis takes one thread of algebra, whoever asks for it: a command, a bench or a program."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from explore3d.analysis import build_model
from explore3d.analysis.stages import Stages


class Seen(Exception):
    """How many threads algebra has within a stage."""


def test_a_program_that_analyses_takes_one_thread_of_algebra_as_the_command_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def look(*_: Any) -> None:
        raise Seen({library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"})

    module = import_module("explore3d.analysis.build_model")  # the package's own name is the function's
    monkeypatch.setattr(module, "Work", look)
    log: Any = None
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(Seen) as seen:
        build_model(log, None, None, Stages())
    assert seen.value.args == ({1},)
