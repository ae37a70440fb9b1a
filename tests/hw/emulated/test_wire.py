"""A slow line: bytes one after another, late, in lumps; and a slide over one."""

from __future__ import annotations

import numpy as np
import pytest
from slow_link import slid

from hw.emulated.wire import Wire


def arrivals(wire: Wire, data: bytes, until: float) -> list[tuple[float, bytes]]:
    wire.send(data, 0.0)
    times = np.arange(0.0, until, 1e-4)
    return [(float(t), got) for t in times if (got := wire.arrived(float(t)))]


def test_bytes_leave_at_the_baud_rate_after_the_latency() -> None:
    found = arrivals(Wire(115200, latency=0.012), bytes(100), 0.05)
    assert b"".join(got for _, got in found) == bytes(100)
    assert found[0][0] == pytest.approx(0.012, abs=3e-4)
    assert found[-1][0] == pytest.approx(0.012 + 1000 / 115200, abs=3e-4)


def test_an_adapter_hands_on_what_it_has_when_its_timer_ends_or_its_packet_is_full() -> None:
    found = arrivals(Wire(1_000_000, timer=0.016), bytes(30), 0.1)
    assert [(at, len(got)) for at, got in found] == [(pytest.approx(0.016, abs=3e-4), 30)]
    lumps = [len(got) for _, got in arrivals(Wire(1_000_000, timer=0.016), bytes(200), 0.1)]
    assert sum(lumps) == 200 and max(lumps) >= 62


@pytest.mark.slow
@pytest.mark.parametrize("timer", [0.0, 0.016])
@pytest.mark.parametrize("latency", [0.005, 0.012, 0.02])
def test_over_a_slow_link_a_slide_is_as_gentle_and_nearly_as_fast_and_right(latency: float, timer: float) -> None:
    found = slid(latency, timer, sweeps=5)
    assert np.median([each.seconds for each in found]) <= 1.5  # a host whose cores are taken makes one of them slower
    assert np.median([each.rms for each in found]) <= 3e-6
    assert max(each.strongest for each in found) <= 1.5
