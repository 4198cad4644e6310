"""The compiled form of what the replay buffer works out for each frame: equal to the plain forms, bit for bit.

Plain are `duplicates.thumbnail`, `duplicates.repeats`, `policies.poorest`, `class_counts.tally` and
`class_counts.replace`; arguments are described there. All arrays lie in C order.
"""

from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from replay.compiling import Compiled, jit

KERNELS = Compiled("replay.buffer_kernels")

_SIDE = 8
_UNIQUE = 1 << 40
_MOST = np.iinfo(np.int64).max


def build() -> SimpleNamespace:
    """`thumbnail`, `repeats`, `poorest`, `tally`, `replace`."""

    @jit("uint8[::1](uint8[:, :, ::1])")
    def thumbnail(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        height, width, channels = picture.shape
        lines = picture.reshape(height, width * channels)
        small = np.empty(_SIDE * _SIDE, np.uint8)
        sums = np.empty(width * channels, np.uint32)
        for part in range(_SIDE):
            top = part * height // _SIDE
            bottom = max((part + 1) * height // _SIDE, top + 1)
            sums[:] = 0
            for y in range(top, bottom):
                for k in range(len(sums)):
                    sums[k] += np.uint32(lines[y, k])
            for column in range(_SIDE):
                left = column * width // _SIDE
                right = max((column + 1) * width // _SIDE, left + 1)
                total = 0
                for k in range(left * channels, right * channels):
                    total += np.int64(sums[k])
                small[part * _SIDE + column] = total // ((bottom - top) * (right - left) * channels)
        return small

    @jit(
        "boolean(uint8[::1], int8[::1], uint8[:, ::1], int64[::1], int64[::1], int64[::1], int8[:, ::1], float64)",
    )
    def repeats(
        mine: NDArray[np.uint8],
        my_labels: NDArray[np.int8],
        thumbnails: NDArray[np.uint8],
        slots: NDArray[np.int64],
        ids: NDArray[np.int64],
        ids_now: NDArray[np.int64],
        labels: NDArray[np.int8],
        distance: float,
    ) -> bool:
        for other in range(len(slots)):
            apart = np.int32(0)
            for k in range(len(mine)):
                apart += abs(np.int32(thumbnails[other, k]) - np.int32(mine[k]))
            if apart < distance * len(mine) and ids_now[slots[other]] == ids[other]:
                differ = False
                for k in range(len(my_labels)):
                    differ |= my_labels[k] >= 0 and my_labels[k] != labels[slots[other], k]
                if not differ:
                    return True
        return False

    @jit("int64(int64[::1], int8[:, ::1], int64[:, ::1], float64)")
    def poorest(
        slots: NDArray[np.int64], labels: NDArray[np.int8], counts: NDArray[np.int64], positives_floor: float
    ) -> int:
        rarity = np.empty_like(counts)
        for kind in range(2):
            for k in range(counts.shape[1]):
                # Rounded down, the quotient of two floats is exact here, and found several at a time.
                rarity[kind, k] = np.int64(_UNIQUE / max(counts[kind, k], 1))
        worth = np.empty(len(slots), np.int64)
        positive = np.empty(len(slots), np.bool_)
        for n in range(len(slots)):
            row = labels[slots[n]]
            total, ones = np.int64(0), np.int64(0)
            for k in range(len(row)):
                negative, one = np.int64(row[k] == 0), np.int64(row[k] == 1)
                total += negative * rarity[0, k] + one * rarity[1, k]
                ones += one
            worth[n], positive[n] = total, ones > 0
        safe = positive[:-1].sum() < positives_floor * (len(slots) - 1)
        least, chosen = _MOST, -1
        for n in range(len(slots)):
            if worth[n] < least and not (safe and positive[n]):
                least, chosen = worth[n], n
        return chosen if chosen >= 0 else int(np.argmin(worth))

    @jit("void(int8[::1], int64, int64[:, ::1])")
    def tally(labels: NDArray[np.int8], sign: int, counts: NDArray[np.int64]) -> None:
        for k in range(len(labels)):
            counts[0, k] += sign * (labels[k] == 0)
            counts[1, k] += sign * (labels[k] == 1)

    @jit("void(int64[::1], int8[:, ::1], float32[:, ::1], int8[:, ::1], float32[:, ::1], int64[:, ::1])")
    def replace(
        slots: NDArray[np.int64],
        new_labels: NDArray[np.int8],
        new_weight: NDArray[np.float32],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
        counts: NDArray[np.int64],
    ) -> None:
        for n in range(len(slots)):
            slot = slots[n]
            if slot < 0:
                continue
            for k in range(labels.shape[1]):
                old, new = labels[slot, k], new_labels[n, k]
                counts[0, k] += np.int64(new == 0) - np.int64(old == 0)
                counts[1, k] += np.int64(new == 1) - np.int64(old == 1)
                labels[slot, k], weight[slot, k] = new, new_weight[n, k]

    return SimpleNamespace(thumbnail=thumbnail, repeats=repeats, poorest=poorest, tally=tally, replace=replace)
