"""Weights on the wire: safetensors with the version in its header."""

import json
import struct

import numpy as np
import safetensors
import safetensors.numpy

from llrp_online.predictor import FloatArrays

_HEADER = struct.Struct("<Q")


class WeightsError(ValueError):
    """Bytes that are no weights of ours."""


def encode(weights: FloatArrays, version: int) -> bytes:
    """Name to float32 array, as bytes.

    >>> import numpy as np
    >>> decode(encode({"bias": np.ones(2, np.float32)}, 7))[1]
    7
    """
    return safetensors.numpy.save(dict(weights), metadata={"version": str(version)})


def decode(data: bytes) -> tuple[FloatArrays, int]:
    """The weights and their version; WeightsError where the bytes are damaged, or a weight is no number."""
    try:
        (size,) = _HEADER.unpack_from(data)
        header = json.loads(data[_HEADER.size : _HEADER.size + size])
        arrays, version = safetensors.numpy.load(data), int(header["__metadata__"]["version"])
    # Any JSON may stand where the header should.
    except (struct.error, ValueError, KeyError, TypeError, safetensors.SafetensorError) as error:
        raise WeightsError(f"not weights with a version: {error!r}") from error
    if bad := [name for name, array in arrays.items() if not np.isfinite(array).all()]:
        raise WeightsError(f"weights, version {version}: not finite (NaN or infinite): {', '.join(bad)}")
    return arrays, version
