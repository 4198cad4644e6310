"""The compiled form of `llrp_online.resampling`: a radix sort, and a walk along the ranks for all resamples at once."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.compiling import jit

# 32 bits are sorted in three rounds; the counts of one round, 16 kB, stay in the fastest cache.
_DIGIT_BITS, _DIGITS = 11, 3
_VALUES = 1 << _DIGIT_BITS
_PAIRS_WON = "UniTuple(int64[::1], 3)(int64[::1], {0}[::1], boolean[::1], int32[:, ::1])"


def build() -> SimpleNamespace:
    """`rank(scores, labels)` and `pairs_won(rows, scores, positive, times)`."""

    @jit("Tuple((int64[::1], float32[::1], boolean[::1]))(float32[::1], int8[::1])")
    def rank(
        scores: NDArray[np.float32], labels: NDArray[np.int8]
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.bool_]]:
        bits = scores.view(np.uint32)
        items, other = np.empty(len(labels), np.uint64), np.empty(len(labels), np.uint64)
        counts = np.zeros((_DIGITS, _VALUES), np.int64)
        known = 0
        for row in range(len(labels)):
            if labels[row] >= 0:
                # A float's bits as a whole number, made to ascend with it; its row rides along in the lower half.
                key = ~bits[row] if bits[row] >> 31 else bits[row] | np.uint32(1 << 31)
                items[known] = (np.uint64(key) << np.uint64(32)) | np.uint64(row)
                known += 1
                for digit in range(_DIGITS):
                    counts[digit, (key >> (digit * _DIGIT_BITS)) & (_VALUES - 1)] += 1
        for digit in range(_DIGITS):
            begin = np.cumsum(counts[digit]) - counts[digit]
            shift = np.uint64(32 + digit * _DIGIT_BITS)
            for item in items[:known]:
                value = np.int64((item >> shift) & np.uint64(_VALUES - 1))
                other[begin[value]] = item
                begin[value] += 1
            items, other = other, items
        rows, ascending, positive = np.empty(known, np.int64), np.empty(known, np.float32), np.empty(known, np.bool_)
        for place in range(known):
            row = np.int64(items[place] & np.uint64(0xFFFFFFFF))
            rows[place], ascending[place], positive[place] = row, scores[row], labels[row] == 1
        return rows, ascending, positive

    @jit([_PAIRS_WON.format("float32"), _PAIRS_WON.format("float64")])
    def pairs_won(
        rows: NDArray[np.int64],
        scores: NDArray[np.floating[Any]],
        positive: NDArray[np.bool_],
        times: NDArray[np.int32],
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        rounds = times.shape[1]
        twice = np.zeros(rounds, np.int64)
        positives, negatives = np.zeros(rounds, np.int64), np.zeros(rounds, np.int64)
        begin = 0
        while begin < len(rows):
            end = begin + 1
            while end < len(rows) and scores[end] == scores[begin]:
                end += 1
            # A tie wins half: its positives meet the negatives below it, and those of the tie once it is passed.
            for place in range(begin, end):
                if positive[place]:
                    drawn = times[rows[place]]
                    for r in range(rounds):
                        positives[r] += drawn[r]
                        twice[r] += drawn[r] * negatives[r]
            for place in range(begin, end):
                if not positive[place]:
                    drawn = times[rows[place]]
                    for r in range(rounds):
                        negatives[r] += drawn[r]
            for place in range(begin, end):
                if positive[place]:
                    drawn = times[rows[place]]
                    for r in range(rounds):
                        twice[r] += drawn[r] * negatives[r]
            begin = end
        return twice, positives, negatives

    return SimpleNamespace(rank=rank, pairs_won=pairs_won)
