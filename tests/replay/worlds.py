"""Random drives to hold the store against: stops, reversals, turns, drop-outs, jumps, unknown bits, late mail."""

import math

import numpy as np

from tests.replay.brute import Frame, Odometry, Reading


def drive(rng, seconds, streams, *, jumps=True, dropouts=True, t0_ns=10**9):
    """Odometry, readings and frames of one random drive, each in order of time."""
    x, y, yaw = rng.normal(size=3)
    t_ns, end_ns = t0_ns, t0_ns + round(seconds * 1e9)
    odometry = []
    v = w = 0.0
    while t_ns < end_ns:
        if rng.random() < 0.15:
            kind = rng.integers(5)
            v = (0.0, 0.4, -0.4, 0.0, 0.25)[kind]
            w = (0.0, 0.0, 0.0, rng.choice([-1.5, 1.5]), rng.normal())[kind]
        step_ns = int(rng.integers(80_000_000, 120_000_000))
        if jumps and rng.random() < 0.01:
            x += 3.0
        if not dropouts or rng.random() < 0.92:
            odometry.append(Odometry(t_ns, (x, y, math.remainder(yaw, math.tau))))
        x, y = x + v * 0.1 * math.cos(yaw), y + v * 0.1 * math.sin(yaw)
        yaw += w * 0.1
        t_ns += step_ns
        if dropouts and rng.random() < 0.01:
            t_ns += 900_000_000
    times = lambda n: np.unique(rng.integers(t0_ns - 10**8, end_ns, n)).tolist()  # noqa: E731
    readings = []
    for stream, sensors in enumerate(streams):
        for t in times(int(seconds * 8)):
            bits = [int(b) for b in rng.choice([0, 1, -1], len(sensors), p=[0.6, 0.3, 0.1])]
            readings.append(Reading(t, stream, bits))
    # Some readings fall on an odometry sample exactly.
    for sample in odometry[::7]:
        if all(r.t_ns != sample.t_ns for r in readings if r.stream == 0):
            readings.append(Reading(sample.t_ns, 0, [1] * len(streams[0])))
    frames = [Frame(t, i) for i, t in enumerate(times(int(seconds * 5)))]
    return odometry, readings, frames


def mail(rng, events, max_delay_s):
    """The order of arrival when each message is late by up to `max_delay_s`."""
    delays = rng.random(len(events)) ** 2 * max_delay_s * 0.99
    order = np.argsort([e.t_ns * 1e-9 + d for e, d in zip(events, delays, strict=True)], kind="stable")
    return [events[i] for i in order]
