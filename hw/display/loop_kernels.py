"""The loop that lets a hand feel a body (numba): read, proxy, passivity, limits, write, at an even rate.

Every device, a simulated one too, is two C functions (hw.display.device.Calls). Nothing here holds Python's lock.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh import dot, sub
from mapping.geometry.proxy import proxy_step, workspace

# Columns of a record: time, device (3), proxy (3), force (3), touching, lateness, computing time, energy
RECORD = 14
RUNNING, ENDED, DEVICE_SILENT, DEVICE_FROZEN, DEVICE_LOST, ASKED_TO_STOP, DEVICE_HUNG = 0, 1, 2, 3, 4, 5, 6
# s; a device that says nothing for so long is let go of: with the period of 1 kHz, 5 ms
PATIENCE_TIME = 4e-3
MONOTONIC = 1  # clock_gettime's number of the clock that nobody sets
AT_DEVICE = 1e-6  # of the radius: a proxy so near to the device's place is there
SPIN_TIME = 80e-6  # s before the instant that sleeping ends and waiting begins: a sleep is late by about as much


@njit(cache=True, error_model="numpy")
def seconds(clock, stamp):  # type: ignore[no-untyped-def]
    """The clock's time, s."""
    clock(np.int64(MONOTONIC), np.int64(stamp.ctypes.data))
    return stamp[0] + 1e-9 * stamp[1]


@njit(cache=True, error_model="numpy", nogil=True)
def run_loop(  # type: ignore[no-untyped-def]
    body, radius, frame, friction, stiffness, virtual, controlled, damping, most_force, dithers,
    own_time, read, write, device, clock, sleep, paced, period, steps, control, state, ring,
):  # fmt: skip
    """Run steps until they are done, `control[0]` is set, or the device is lost; the reason.

    Args:
        body, radius: of the proxy, in the kernels' frame.
        frame: (5,) device to kernels' frame: scale, offset (3,); and device metres in one metre of that frame.
        friction, stiffness (N/m), virtual damping (N s/m).
        controlled: True bounds the force by the energy that is there; the observer always runs.
        damping: of the device, N s/m; most_force: N; dithers: True if its positions never repeat.
        own_time: True of a device whose samples are a period apart however late they are asked for.
        read, write, device: its functions and their state; clock, sleep: the C library's.
        paced: True keeps to the clock; False simulates as fast as it can, with the time of the steps.
        period: s; steps: at most.
        control: (4,) int64: 1 to stop, 2 because the device hung; steps done, reason, number of the last record + 1.
        state: (12,) what is kept between calls: proxy (3), last place (3), both in the kernels' frame, last force (3),
            energy (J), whether the device was outside of the body before.
        ring: (R, RECORD) the newest records.
    """
    work = workspace()
    stamp, rest = np.zeros(2, np.int64), np.zeros(2, np.int64)
    place, force = np.zeros(3), np.zeros(3)
    scale, back = frame[0], frame[4]
    proxy = (state[0], state[1], state[2])
    last = (state[3], state[4], state[5])
    felt = (state[6], state[7], state[8])
    energy = state[9]
    reason = ENDED
    first = control[1]
    begin = seconds(clock, stamp) - first * period
    heard = held = first * period
    missed = 0.0
    for n in range(steps):
        due = (first + n) * period + missed
        late, now = 0.0, due
        if paced:
            now = seconds(clock, stamp) - begin
            if due - now > SPIN_TIME:
                rest[1] = np.int64(1e9 * (due - now - SPIN_TIME))
                rest[0] = rest[1] // 1_000_000_000
                rest[1] -= 1_000_000_000 * rest[0]
                sleep(np.int64(rest.ctypes.data), np.int64(0))
                now = seconds(clock, stamp) - begin
            while now < due:
                now = seconds(clock, stamp) - begin
            late = now - due
            if late > period:  # what was missed is missed: no burst of steps makes up for it
                missed += late
        if control[0] != 0:
            reason = ASKED_TO_STOP if control[0] == 1 else DEVICE_HUNG
            break
        answer = read(device, np.int64(place.ctypes.data))
        if answer < 0:
            reason = DEVICE_LOST
            break
        x = last
        if answer == 0:
            heard = now
            x = (scale * place[0] + frame[1], scale * place[1] + frame[2], scale * place[2] + frame[3])
        if now - heard > PATIENCE_TIME:
            reason = DEVICE_SILENT
            break
        dx = (back * (x[0] - last[0]), back * (x[1] - last[1]), back * (x[2] - last[2]))
        square = dx[0] * dx[0] + dx[1] * dx[1] + dx[2] * dx[2]
        if square > 0.0 or not dithers:
            held = now
        if now - held > PATIENCE_TIME and n > 0:
            reason = DEVICE_FROZEN
            break
        if not (square < np.inf):
            reason = DEVICE_LOST
            break
        # what the hand gave since the last force, and the least that the mechanism took of it (Cauchy and Schwarz)
        span = period if own_time else period + late
        energy += damping * square / span - (felt[0] * dx[0] + felt[1] * dx[1] + felt[2] * dx[2])
        proxy, touching = proxy_step(body, radius, friction, proxy, last, x, work)
        away = sub(proxy, x)
        away = sqrt(dot(away, away))
        # a hand that begins inside of the body is not thrown out: it feels nothing until it was outside once
        if away <= AT_DEVICE * radius:
            state[10] = 1.0
        if state[10] == 0.0:
            away = 0.0
        # The spring pulls whenever the two are apart, also while the proxy is still on its way: a force that waits for
        # contact would come from nowhere
        pull = stiffness * back
        f0, f1, f2, drag = 0.0, 0.0, 0.0, 0.0
        if away > 0.0:
            f0, f1, f2 = pull * (proxy[0] - x[0]), pull * (proxy[1] - x[1]), pull * (proxy[2] - x[2])
            drag = virtual / span if touching else 0.0
        # What the springs hold is the hand's to take back; credit beyond it is dropped, so that none is saved up
        pull *= back
        soft = min(away, most_force * back / pull)  # beyond, the force is limited
        stored = pull * soft * (away - 0.5 * soft)
        energy = min(energy, stored)
        f0, f1, f2 = f0 - drag * dx[0], f1 - drag * dx[1], f2 - drag * dx[2]
        size = sqrt(f0 * f0 + f1 * f1 + f2 * f2)
        # Whatever the hand does next, it gets back no more than is there: -F.dx + b dx^2 / T is least -F^2 T / (4 b)
        most = most_force
        if controlled:
            most = min(most, sqrt(max(4.0 * damping * energy / period, 0.0)))
        share = most / size * (1.0 - 1e-12) if size > most else 1.0
        felt = (share * f0, share * f1, share * f2)
        force[0], force[1], force[2] = felt
        if write(device, np.int64(force.ctypes.data)) < 0:
            reason = DEVICE_LOST
            break
        last = x
        row = control[3] % len(ring)
        ring[row, 0] = now
        for k in range(3):
            ring[row, 1 + k], ring[row, 4 + k], ring[row, 7 + k] = x[k], proxy[k], force[k]
        ring[row, 10], ring[row, 11], ring[row, 13] = (1.0 if touching else 0.0), late, energy
        ring[row, 12] = seconds(clock, stamp) - begin - now if paced else 0.0
        control[3] += 1
        control[1] += 1
    if reason != ENDED:
        force[:] = 0.0
        felt = (0.0, 0.0, 0.0)
        write(device, np.int64(force.ctypes.data))
    state[0], state[1], state[2] = proxy
    state[3], state[4], state[5] = last
    state[6], state[7], state[8] = felt
    state[9] = energy
    control[2] = reason
    return reason
