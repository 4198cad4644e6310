"""One number for a set of weights: equal if and only if they are the same, byte for byte."""

import hashlib

from llrp_online.architecture import Weights


def weights_sha256(weights: Weights) -> str:
    """SHA-256 over names, shapes and float32 values, in order of name.

    >>> import numpy as np
    >>> a, b = np.zeros(2, np.float32), np.ones(2, np.float32)
    >>> weights_sha256({"a": a, "b": b}) == weights_sha256({"b": b, "a": a})
    True
    """
    digest = hashlib.sha256()
    for name in sorted(weights):
        digest.update(f"{name}{weights[name].shape}".encode())
        digest.update(weights[name].astype("<f4").tobytes())
    return digest.hexdigest()
