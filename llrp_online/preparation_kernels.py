"""The compiled form of augmentation and standardisation: one picture after the other, while it is in the cache."""

from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from llrp_online.architecture import DEVIATION_FLOOR
from llrp_online.augment import LUMA
from replay.compiling import jit

_RED, _GREEN, _BLUE = (np.float32(share) for share in LUMA)
_FLOOR = np.float32(DEVIATION_FLOOR)
#: Sums may be taken in any order, several terms at a time; the order is the same in every run.
_LOOSELY = {"reassoc", "nsz", "contract", "arcp"}


def build() -> SimpleNamespace:
    """`prepare`, which fills three arrays; see `Preparation` and `Draw` for what it is given."""

    @jit("void(float32[::1])", fastmath=_LOOSELY)
    def to_grey(line: NDArray[np.float32]) -> None:
        for x in range(len(line) // 3):
            luma = _RED * line[3 * x] + _GREEN * line[3 * x + 1] + _BLUE * line[3 * x + 2]
            line[3 * x] = line[3 * x + 1] = line[3 * x + 2] = luma

    @jit("void(float32[:, ::1], float32)", fastmath=_LOOSELY)
    def standardise(lines: NDArray[np.float32], mean: np.float32) -> None:
        square = 0.0
        for y in range(len(lines)):
            part = np.float32(0)
            for k in range(lines.shape[1]):
                apart = lines[y, k] - mean
                part += apart * apart
            square += part
        scale = np.float32(1) / max(np.float32(np.sqrt(square / lines.size)), _FLOOR)
        for y in range(len(lines)):
            for k in range(lines.shape[1]):
                lines[y, k] = (lines[y, k] - mean) * scale

    @jit(
        "void(uint8[:, :, :, ::1], int8[:, ::1], float32[:, ::1], int64[::1],"
        " boolean[::1], float32[::1], int64[::1], boolean[::1], float32[::1], float32[::1],"
        " float32[::1], float32[::1], float32[::1], uint32[::1], int64[::1],"
        " float32[:, :, :, ::1], int8[:, ::1], float32[:, ::1])",
        fastmath=_LOOSELY,
    )
    def prepare(
        pictures: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
        rows: NDArray[np.int64],
        flip: NDArray[np.bool_],
        grain: NDArray[np.float32],
        grain_from: NDArray[np.int64],
        grey: NDArray[np.bool_],
        right: NDArray[np.float32],
        down: NDArray[np.float32],
        grains: NDArray[np.float32],
        across: NDArray[np.float32],
        along: NDArray[np.float32],
        mirrored: NDArray[np.uint32],
        entries: NDArray[np.int64],
        out_pictures: NDArray[np.float32],
        out_labels: NDArray[np.int8],
        out_weight: NDArray[np.float32],
    ) -> None:
        _, height, width, channels = pictures.shape
        size = width * channels
        straight, shade = np.empty(size, np.float32), np.empty(size, np.float32)
        for n in range(len(rows)):
            source, lines = pictures[rows[n]].reshape(height, size), out_pictures[n].reshape(height, size)
            for k in range(size):
                shade[k] = right[n] * across[k]
            total = 0.0
            for y in range(height):
                line, shown = source[y], lines[y]
                if flip[n]:
                    # Read forwards first: reading a picture backwards that is not in the cache yet takes twice as long.
                    for k in range(size):
                        straight[k] = np.float32(line[k])
                    for k in range(size):
                        shown[k] = straight[mirrored[k]]
                else:
                    for k in range(size):
                        shown[k] = np.float32(line[k])
                if grain[n]:
                    noise = grains[grain_from[n] + y * size : grain_from[n] + (y + 1) * size]
                    for k in range(size):
                        shown[k] += grain[n] * noise[k]
                if grey[n]:
                    to_grey(shown)
                fall, part = down[n] * along[y], np.float32(0)
                for k in range(size):
                    shown[k] += shade[k] + fall
                    part += shown[k]
                total += part
            standardise(lines, np.float32(total / lines.size))
            for k in range(len(entries)):
                entry = entries[k] if flip[n] else k
                out_labels[n, k], out_weight[n, k] = labels[rows[n], entry], weight[rows[n], entry]

    return SimpleNamespace(prepare=prepare)
