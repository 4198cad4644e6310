"""Who stays in a full memory: balanced over target x class, a plain reservoir, or first in first out.

A policy is called with a view of the memory and says whose place the newcomer takes. Each takes as long in a large
memory as in a small one.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from replay.buffer_kernels import KERNELS
from replay.class_counts import Counts
from replay.slots import places

#: The balanced policy looks for who leaves among so many frames, drawn at random.
_CANDIDATES = 64
#: What a label is worth that no other frame has. In whole numbers, sums do not depend on the order of their terms.
_UNIQUE = 1 << 40


class MemoryView(NamedTuple):
    """What a policy may look at.

    Attributes:
        memory: (M,) slots in memory; a newcomer takes the place of the one it follows.
        candidate: the slot that wants in.
        ids: (slots,) frame id in each slot, growing with time.
        labels: (slots, L) int8.
        counts: (2, L) known labels of each class over all frames kept.
        offered: frames offered to memory so far, this one included.
    """

    memory: NDArray[np.int64]
    candidate: int
    ids: NDArray[np.int64]
    labels: NDArray[np.int8]
    counts: Counts
    offered: int


class Policy(Protocol):
    """Decides who leaves a full memory."""

    def __call__(self, view: MemoryView, random: np.random.Generator, /) -> int | None:
        """The place in `view.memory` that the newcomer takes; None: it is the newcomer who leaves."""
        ...


class Balanced:
    """The frame whose known labels are the most common leaves; frames with a positive are safe below their floor.

    A frame is worth the sum, over its known labels, of one over the count of that target, sensor and class: the greedy
    form of keeping target x class counts even (Chrysakis & Moens 2020, "Online continual learning from imbalanced
    data"; Liang et al. 2022, OCDM).
    """

    def __init__(self, positives_floor: float) -> None:
        self._floor = positives_floor

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int | None:
        """The place of the frame that is worth least, of 64 drawn at random and the newcomer."""
        drawn = places(random, len(view.memory), _CANDIDATES)
        slots = np.empty(_CANDIDATES + 1, np.int64)
        slots[:-1], slots[-1] = view.memory[drawn], view.candidate
        kernels = KERNELS.get()
        leaves = (poorest if kernels is None else kernels.poorest)(slots, view.labels, view.counts, self._floor)
        return int(drawn[leaves]) if leaves < _CANDIDATES else None


def poorest(slots: NDArray[np.int64], labels: NDArray[np.int8], counts: Counts, positives_floor: float) -> int:
    """Which of `slots` (N,), the last of them the newcomer's, is worth least; see `Balanced` and `MemoryView`."""
    rows = labels[slots]
    rarity = _UNIQUE // np.maximum(counts, 1)
    worth = np.where(rows == 1, rarity[1], np.where(rows == 0, rarity[0], 0)).sum(1)
    positive = (rows == 1).any(1)
    if positive[:-1].sum() < positives_floor * (len(slots) - 1) and not positive.all():
        worth[positive] = np.iinfo(np.int64).max
    return int(worth.argmin())


class Reservoir:
    """Every frame ever offered is equally likely to be in memory (Vitter 1985, algorithm R)."""

    def __init__(self, positives_floor: float) -> None:
        del positives_floor  # every frame alike is the whole point

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int | None:
        """A place drawn at random, the more often None the more frames there have been."""
        drawn = int(random.integers(0, view.offered))
        return drawn if drawn < len(view.memory) else None


class Fifo:
    """The oldest frame leaves.

    Newcomers take the oldest one's place, so the memory is a ring, and the next place has the next oldest. One that
    was filled under another policy is one after its first round.
    """

    def __init__(self, positives_floor: float) -> None:
        del positives_floor  # age is all that counts
        self._next: int | None = None

    def __call__(self, view: MemoryView, random: np.random.Generator) -> int | None:
        """The place after the last."""
        del random
        if self._next is None:
            self._next = int(view.ids[view.memory].argmin())
        place = self._next % len(view.memory)
        self._next = place + 1
        return place


POLICIES: dict[str, Callable[[float], Policy]] = {"balanced": Balanced, "reservoir": Reservoir, "fifo": Fifo}
