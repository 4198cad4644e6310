"""Who stays in a full memory: balanced over target x class, a plain reservoir, or first in first out.

A policy is called with a view of the memory and returns the slot that leaves: one of the memory's, or the candidate's.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

#: The balanced policy looks for who leaves among so many frames, drawn at random: the cost is flat in the memory.
_CANDIDATES = 64


@dataclass(frozen=True, eq=False)
class MemoryView:
    """What a policy may look at.

    Attributes:
        memory: (M,) slots in memory.
        candidate: the slot that wants in.
        ids: (slots,) frame id in each slot, growing with time.
        labels: (slots, T, S) int8.
        counts: (T, S, 2) known labels of each class over all frames kept.
        offered: frames offered to memory so far, this one included.
    """

    memory: NDArray[np.int64]
    candidate: int
    ids: NDArray[np.int64]
    labels: NDArray[np.int8]
    counts: NDArray[np.int64]
    offered: int


class Policy(Protocol):
    """Decides who leaves a full memory."""

    def __call__(self, view: MemoryView, random: np.random.Generator, /) -> int:
        """The slot that leaves."""
        ...


class Balanced:
    """The frame whose known labels are the most common leaves; frames with a positive are safe below their floor.

    A frame is worth the sum, over its known labels, of one over the count of that target, sensor and class: the greedy
    form of keeping target x class counts even (Chrysakis & Moens 2020, "Online continual learning from imbalanced
    data"; Liang et al. 2022, OCDM).
    """

    def __init__(self, positives_floor: float) -> None:
        self._floor = positives_floor

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int:
        """The slot that leaves."""
        drawn = view.memory[random.integers(0, len(view.memory), _CANDIDATES)]
        slots = np.append(drawn, view.candidate)
        labels = view.labels[slots]
        rarity = 1.0 / np.maximum(view.counts, 1)
        worth = np.where(labels == 1, rarity[..., 1], np.where(labels == 0, rarity[..., 0], 0.0)).sum((1, 2))
        positive = (labels == 1).any((1, 2))
        if positive[:-1].mean() < self._floor and not positive.all():
            worth[positive] = np.inf
        return int(slots[worth.argmin()])


class Reservoir:
    """Every frame ever offered is equally likely to be in memory (Vitter 1985, algorithm R)."""

    def __init__(self, positives_floor: float) -> None:
        del positives_floor  # every frame alike is the whole point

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int:
        """The slot that leaves."""
        drawn = int(random.integers(0, view.offered))
        return int(view.memory[drawn]) if drawn < len(view.memory) else view.candidate


class Fifo:
    """The oldest frame leaves."""

    def __init__(self, positives_floor: float) -> None:
        del positives_floor  # age is all that counts

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int:
        """The slot that leaves."""
        del random
        return int(view.memory[view.ids[view.memory].argmin()])


POLICIES: dict[str, Callable[[float], Policy]] = {"balanced": Balanced, "reservoir": Reservoir, "fifo": Fifo}
