"""Squared error averaged over the known labels alone: the paper's loss, freed of how many labels happen to be known."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from llrp_online import losses
from llrp_online.trainer import Trainer


class SquaredErrorTrainer(Trainer):
    """Takes the same steps down another slope; positives weigh what they weigh in the cross-entropy."""

    def error(self, logits: Tensor, labels: Tensor, weight: Tensor, class_counts: NDArray[np.int64]) -> Tensor:
        """Of logits, labels and weights, (N, T, S)."""
        known, positive = labels >= 0, labels > 0
        balance = losses.positive_weights(class_counts, self._settings.positive_weight_max)
        cost = torch.where(known, weight, 0.0) * torch.where(positive, balance, 1.0)
        error = torch.sigmoid(logits) - positive.to(torch.float32)
        return (cost * error.square()).sum() / known.sum().clamp(min=1)
