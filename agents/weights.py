"""Weights on the wire: a safetensors file with the version in its header, written and read without a copy to spare.

The format is the library's, so that anyone can read what a learner sends. Its own functions copy every array several
times, and take longer than what they copy; they are the reference that the tests hold this module against.
"""

import json
import math
import struct
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online.predictor import FloatArrays

_HEADER = struct.Struct("<Q")
_ALIGNMENT = 8
_METADATA = "__metadata__"
_FLOAT = np.dtype("<f4")


class WeightsError(ValueError):
    """Bytes that are no weights of ours."""


def encode(weights: FloatArrays, version: int) -> bytes:
    """Name to float32 array, as bytes.

    >>> import numpy as np
    >>> decode(encode({"bias": np.ones(2, np.float32)}, 7))[1]
    7
    """
    arrays = [np.asarray(array, _FLOAT, order="C") for array in weights.values()]
    places = _places(tuple((name, array.shape) for name, array in zip(weights, arrays, strict=True)))
    text = f'{{{places}"{_METADATA}":{{"version":"{version}"}}}}'.encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    return b"".join((_HEADER.pack(len(text)), text, *(array.data for array in arrays)))


@lru_cache(maxsize=8)
def _places(shapes: tuple[tuple[str, tuple[int, ...]], ...]) -> str:
    """The part of the header that all versions of a network share: where each array lies, as members of an object."""
    found, end = "", 0
    for name, shape in shapes:
        begin, end = end, end + math.prod(shape) * _FLOAT.itemsize
        place = {"dtype": "F32", "shape": shape, "data_offsets": (begin, end)}
        found += f"{json.dumps(name)}:{json.dumps(place)},"
    return found


def decode(data: bytes) -> tuple[FloatArrays, int]:
    """The weights and their version; WeightsError where the bytes are damaged, or a weight is no number.

    The arrays are read-only views of `data`, C-contiguous float32.
    """
    try:
        (size,) = _HEADER.unpack_from(data)
        if size % _ALIGNMENT:
            raise ValueError(f"expected a header of a multiple of {_ALIGNMENT} bytes, got {size}")
        header = json.loads(str(data[_HEADER.size : _HEADER.size + size], "utf-8"))
        version = int(header.pop(_METADATA)["version"])
        flat = np.frombuffer(data, _FLOAT, offset=_HEADER.size + size)
        arrays = dict(_arrays(header, flat))
    # Any JSON may stand where the header should.
    except (struct.error, ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise WeightsError(f"not weights with a version: {error!r}") from error
    if not np.isfinite(flat).all():
        bad = [name for name, array in arrays.items() if not np.isfinite(array).all()]
        raise WeightsError(f"weights, version {version}: not finite (NaN or infinite): {', '.join(bad)}")
    return arrays, version


def _arrays(header: Mapping[str, Any], flat: NDArray[np.float32]) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Each name with its part of all the numbers; ValueError unless the parts are all of them, one after the other."""
    end = 0
    for name, place in sorted(header.items(), key=lambda item: item[1]["data_offsets"]):
        shape = place["shape"]
        begin, end = end, end + math.prod(shape)
        # A list of whole numbers equals one of floats or booleans, and its type is what tells them apart.
        numbers = [*shape, *place["data_offsets"]]
        if numbers[-2:] != [4 * begin, 4 * end] or place["dtype"] != "F32" or set(map(type, numbers)) != {int}:
            raise ValueError(f"{name}: expected F32 from byte {4 * begin} to {4 * end}, got {place}")
        yield name, flat[begin:end].reshape(shape)
    if end != flat.size:
        raise ValueError(f"expected {end} numbers after the header, got {flat.size}")
