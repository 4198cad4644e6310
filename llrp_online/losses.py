"""How wrong a prediction is, where the truth is known: the paper's loss, and a cross-entropy for learning online.

Nava et al. 2019, section IV-E: the error is masked, so that an unknown label teaches nothing. Both losses look at the
known entries alone, so the gradient at an unknown one is exactly zero.

Shapes: logits (N, T, S) float32; labels (N, T, S) int8, 1, 0 or -1 for unknown; weight (N, T, S) float32 in [0, 1], how
far each label is trusted.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional


def paper(logits: Tensor, labels: Tensor, weight: Tensor) -> Tensor:
    """The paper's squared error, averaged over ALL entries with the unknown ones as zero, as its authors ran it.

    Its size therefore follows the density of the labels. The paper knows no weights: there they are all one.

    >>> paper(torch.zeros(1, 1, 2), torch.tensor([[[1, -1]]], dtype=torch.int8), torch.ones(1, 1, 2))
    tensor(0.1250)
    """
    known = labels >= 0
    error = torch.sigmoid(logits[known]) - labels[known]
    return (weight[known] * error.square()).sum() / labels.numel()


def cross_entropy(logits: Tensor, labels: Tensor, weight: Tensor, positive_weight: Tensor | None = None) -> Tensor:
    """Weighted cross-entropy [nats], averaged over the number of KNOWN labels; zero if none is known.

    Args:
        logits: (N, T, S).
        labels: (N, T, S).
        weight: (N, T, S).
        positive_weight: (T, S) float32, what an error on a positive label costs more; None: nothing.

    >>> cross_entropy(torch.zeros(1, 1, 2), torch.tensor([[[1, -1]]], dtype=torch.int8), torch.ones(1, 1, 2))
    tensor(0.6931)
    """
    # Over all entries, the unknown ones with a cost of zero: picking out the known ones takes several times longer.
    known = labels >= 0
    cost = torch.where(known, weight, 0.0)
    if positive_weight is not None:
        cost = cost * torch.where(labels > 0, positive_weight, 1.0)
    # An unknown entry's logit is of no interest, not even if it is no number.
    logits, positive = torch.where(known, logits, 0.0), (labels > 0).to(logits.dtype)
    entropy = functional.binary_cross_entropy_with_logits(logits, positive, cost, reduction="sum")
    return entropy / known.sum().clamp(min=1)


def positive_weights(counts: NDArray[np.integer], maximum: float) -> Tensor:
    """What balances the classes, within bounds: n_neg / n_pos, clipped to [1, maximum].

    Args:
        counts: (T, S, 2), how many labels of each target and sensor are 0 and 1.
        maximum: the clip; 1 turns the balance off.

    Returns:
        (T, S) float32; `maximum` where there are negatives only, 1 where nothing is known.

    >>> positive_weights(np.array([[[90, 45], [90, 1], [0, 9], [9, 0]]]), 4.0)
    tensor([[2., 4., 1., 4.]])
    """
    negative, positive = counts[..., 0].astype(np.float64), counts[..., 1].astype(np.float64)
    return torch.from_numpy(np.clip(negative / np.maximum(positive, 1), 1, maximum).astype(np.float32))
