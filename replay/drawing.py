"""Which frames a batch is made of: some recent, some from memory, and none that was drawn too often already."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.slots import SlotSet

#: Of the dtype of the counts: with a plain 1, adding would take five times as long.
_ONE = np.int32(1)


class Drawing:
    """Slots that may be drawn, in two parts, and how often each has been.

    Args:
        capacity: slots.
        recent_share: of a batch, drawn from the recent ones.
        max_uses: draws, after which a slot is drawn no more.

    >>> drawing = Drawing(capacity=4, recent_share=0.5, max_uses=2)
    >>> for slot in range(3):
    ...     drawing.enter(slot)
    >>> drawing.retire(0)
    >>> drawing.draw(np.random.default_rng(0), 4)
    array([1, 2, 0, 0])
    """

    ROW_BYTES = 4 + 2 * SlotSet.ROW_BYTES

    def __init__(self, capacity: int, recent_share: float, max_uses: int) -> None:
        self._recent_share, self._max_uses = recent_share, max_uses
        self._uses = np.zeros(capacity, np.int32)
        self._recent, self._memory = SlotSet(capacity), SlotSet(capacity)  # those with uses left

    def enter(self, slot: int) -> None:
        """A new frame is in this slot, a recent one."""
        self._uses[slot] = 0
        self._recent.add(slot)

    def retire(self, slot: int) -> None:
        """It is no longer recent, but in memory."""
        self._recent.discard(slot)
        if self._uses[slot] < self._max_uses:
            self._memory.add(slot)

    def leave(self, slot: int) -> None:
        """The slot is empty."""
        self._recent.discard(slot)
        self._memory.discard(slot)

    def draw(self, random: np.random.Generator, size: int) -> NDArray[np.int64] | None:
        """(size,) slots, with replacement; None where none has uses left."""
        if not len(self._recent) and not len(self._memory):
            return None
        from_recent = round(size * self._recent_share)
        if not len(self._memory):
            from_recent = size
        elif not len(self._recent):
            from_recent = 0
        slots = np.concatenate([self._recent.draw(random, from_recent), self._memory.draw(random, size - from_recent)])
        np.add.at(self._uses, slots, _ONE)
        for slot in slots[self._uses[slots] >= self._max_uses].tolist():
            self.leave(slot)
        return slots

    def state(self, slots: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """For `restore`, after the frames of all slots in use have moved: each is told by its row in `slots`."""
        row = np.zeros(len(self._uses), np.int64)
        row[slots] = np.arange(len(slots))
        return {"uses": self._uses[slots], "usable": row[np.concatenate([self._recent.all, self._memory.all])]}

    def restore(self, state: Mapping[str, NDArray[Any]], recent: int) -> None:
        """Go on from `state`, its rows being the slots now, the first `recent` of them the recent ones.

        Those that may be drawn lie in the order saved; after them, those that may be drawn now and could not then.
        """
        self._recent.clear()
        self._memory.clear()
        count, saved = len(state["uses"]), state.get("usable", np.zeros(0, np.int64))  # older checkpoints lack it
        self._uses[:count] = state["uses"]
        usable = self._uses[:count] < self._max_uses
        slots = np.concatenate([saved[usable[saved]], np.setdiff1d(np.flatnonzero(usable), saved)])
        self._recent.extend(slots[slots < recent])
        self._memory.extend(slots[slots >= recent])
