"""Weights on the wire: whole or refused."""

import json
import struct

import numpy as np
import pytest
import safetensors.numpy
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from agents import weights
from agents.weights import WeightsError

FLOATS = arrays(
    np.float32,
    array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
    elements=st.floats(width=32, allow_nan=False, allow_infinity=False),
)
SETS = st.dictionaries(st.text(max_size=8).filter(lambda name: name != "__metadata__"), FLOATS, max_size=5)

ARRAYS = {"layer.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "layer.bias": np.zeros(2, np.float32)}
WHOLE = weights.encode(ARRAYS, 7)


def test_they_come_back_as_they_were():
    found, version = weights.decode(WHOLE)
    assert version == 7
    assert set(found) == set(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == np.float32


@given(SETS, st.integers(0, 2**40), st.booleans())
def test_the_format_is_the_librarys(given_weights, version, transposed):
    if transposed:
        given_weights = {name: array.T for name, array in given_weights.items()}
    ours = weights.encode(given_weights, version)
    # The library writes what lies in memory, whatever the strides say.
    given_weights = {name: array.copy(order="C") for name, array in given_weights.items()}
    theirs = safetensors.numpy.save(given_weights, metadata={"version": str(version)})
    for data in (ours, theirs):
        read, found = weights.decode(data)
        assert found == version
        assert_same(read, safetensors.numpy.load(data))
        assert_same(read, given_weights)
        assert not any(array.flags.writeable for array in read.values())


def assert_same(found, expected):
    assert set(found) == set(expected)
    for name, array in expected.items():
        assert (found[name].dtype, found[name].shape) == (np.float32, array.shape)
        assert found[name].tobytes() == array.tobytes()


def headed(header: object) -> bytes:
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text


def placed(dtype: str, shape: list[float], offsets: list[int]) -> object:
    return {"__metadata__": {"version": "1"}, "a": {"dtype": dtype, "shape": shape, "data_offsets": offsets}}


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
        struct.pack("<Q", 31) + b'{"__metadata__":{"version":"1"}}',
        headed(placed("F64", [2], [0, 8])) + bytes(8),
        headed(placed("F32", [2.0], [0, 8])) + bytes(8),
        headed(placed("F32", [True], [0, 4])) + bytes(4),
        headed(placed("F32", [-1, -2], [0, 8])) + bytes(8),
        headed(placed("F32", [1], [4, 8])) + bytes(8),
        headed(placed("F32", [1], [0, 4])) + bytes(8),
        headed(placed("F32", [0, 2**70], [0, 0])),
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
            found, _ = weights.decode(bytes(damaged))
        except WeightsError:
            continue
        assert all(np.isfinite(array).all() for array in found.values())
        assert_same(found, safetensors.numpy.load(bytes(damaged)))
