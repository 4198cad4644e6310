"""Weights on the wire: whole or refused."""

import json
import struct

import numpy as np
import pytest

from agents import weights
from agents.weights import WeightsError

ARRAYS = {"layer.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "layer.bias": np.zeros(2, np.float32)}
WHOLE = weights.encode(ARRAYS, 7)


def test_they_come_back_as_they_were():
    arrays, version = weights.decode(WHOLE)
    assert version == 7
    assert set(arrays) == set(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == np.float32


def headed(header: object) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text


@pytest.mark.parametrize(
    "damaged",
    [
        b"",
        b"1234567",
        b"nonsense that is longer than a header",
        WHOLE[:-1],
        WHOLE[: len(WHOLE) // 2],
        WHOLE + b"\0",
        struct.pack("<Q", 2**63) + WHOLE[8:],
        headed([]),
        headed(None),
        headed({}),
        headed({"__metadata__": []}),
        headed({"__metadata__": {"version": "newest"}}),
        headed({"__metadata__": {"version": None}}),
        headed({"__metadata__": {"version": "1"}, "a": {"dtype": "F32", "shape": [9], "data_offsets": [0, 36]}}),
    ],
)
def test_damaged_bytes_are_refused(damaged):
    with pytest.raises(WeightsError, match="not weights with a version"):
        weights.decode(damaged)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_weights_that_are_no_numbers_are_refused(value):
    broken = ARRAYS | {"layer.bias": np.array([0.0, value], np.float32)}
    with pytest.raises(WeightsError, match=r"weights, version 3: not finite \(NaN or infinite\): layer.bias"):
        weights.decode(weights.encode(broken, 3))


def test_no_byte_flipped_can_do_worse_than_be_refused_or_be_a_number():
    random = np.random.default_rng(0)
    for _ in range(300):
        damaged = bytearray(WHOLE)
        damaged[random.integers(len(damaged))] ^= 1 << int(random.integers(8))
        try:
            arrays, _ = weights.decode(bytes(damaged))
        except WeightsError:
            continue
        assert all(np.isfinite(array).all() for array in arrays.values())
