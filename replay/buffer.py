"""The replay buffer: pictures with partly known labels, kept under a hard byte budget and drawn in batches.

The newest frames are all kept (`recent`); a frame that is no longer recent is offered to the `memory`, which decides
who stays by its policy (`replay.policies`). A batch is drawn part from each. Labels that improve later are updated in
place. Mask-aware: -1 is unknown throughout, and the counts that balance the memory are of known labels only.
"""

import logging
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from replay.duplicates import Thumbnails
from replay.policies import POLICIES, MemoryView

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class BufferSettings:
    """What the buffer keeps; see `[memory]` in the configuration for units and reasons."""

    budget_bytes: int = 512_000_000
    recent_frames: int = 600
    recent_share: float = 0.5
    policy: str = "balanced"
    max_uses: int = 400
    positives_floor: float = 0.2
    duplicate_distance: float = 2.0
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Batch:
    """N frames to learn from.

    Attributes:
        pictures: (N, H, W, C) uint8.
        labels: (N, T, S) int8: 1, 0, -1 unknown.
        weight: (N, T, S) float32 in [0, 1].
    """

    pictures: NDArray[np.uint8]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class ReplayBuffer:
    """Frames by id, drawn half from the newest and half from memory.

    Args:
        picture_shape: (H, W, C).
        label_shape: (T, S).
        settings: budget and policy.

    >>> buffer = ReplayBuffer((4, 4, 3), (2, 1), BufferSettings(budget_bytes=100_000, recent_frames=8))
    >>> buffer.add(7, np.zeros((4, 4, 3), np.uint8), np.array([[0], [-1]], np.int8), np.ones((2, 1), np.float32))
    >>> buffer.update(7, np.array([[0], [1]], np.int8), np.ones((2, 1), np.float32))
    True
    >>> buffer.sample(2).labels[:, :, 0]
    array([[0, 1],
           [0, 1]], dtype=int8)
    """

    def __init__(
        self, picture_shape: tuple[int, int, int], label_shape: tuple[int, int], settings: BufferSettings
    ) -> None:
        self.settings = settings
        entries = int(np.prod(label_shape))
        self.frame_bytes = int(np.prod(picture_shape)) + entries * (1 + 4) + 8 + 4 + Thumbnails.ROW_BYTES
        self.capacity = settings.budget_bytes // self.frame_bytes
        if self.capacity < 2 * settings.recent_frames:
            raise ValueError(
                f"replay buffer: a budget of {settings.budget_bytes / 1e6:g} MB holds {self.capacity} frames of "
                f"{self.frame_bytes} bytes, but memory.recent_frames = {settings.recent_frames} alone want half of it; "
                f"expected at least {2 * settings.recent_frames * self.frame_bytes / 1e6:.1f} MB: "
                "raise memory.budget_mb or lower memory.recent_frames"
            )
        warn_if_too_large(self.capacity * self.frame_bytes)
        # Zeroed pages cost nothing until they are written: the budget is a bound, not what an empty buffer takes.
        try:
            self._pictures = np.zeros((self.capacity, *picture_shape), np.uint8)
        except MemoryError:
            raise ValueError(
                f"replay buffer: no room for {settings.budget_bytes / 1e6:g} MB here: lower memory.budget_mb"
            ) from None
        self._labels = np.zeros((self.capacity, *label_shape), np.int8)
        self._weight = np.zeros((self.capacity, *label_shape), np.float32)
        self._ids = np.zeros(self.capacity, np.int64)
        self._uses = np.zeros(self.capacity, np.int32)
        self._thumbnails = Thumbnails(self.capacity, settings.duplicate_distance)
        self._counts = np.zeros((*label_shape, 2), np.int64)
        self._slots: dict[int, int] = {}
        self._free = list(range(self.capacity - 1, -1, -1))
        self._recent: deque[int] = deque()
        self._memory: list[int] = []
        self._place: dict[int, int] = {}  # slot -> its index in `_memory`
        self._offered = 0
        self.duplicates = 0
        self._random = np.random.default_rng(settings.seed)
        self._policy = POLICIES[settings.policy](settings.positives_floor)

    # --- what is inside

    def __len__(self) -> int:
        """How many frames are kept."""
        return len(self._slots)

    def __contains__(self, frame_id: int) -> bool:
        """Is the frame kept?"""
        return frame_id in self._slots

    @property
    def sizes(self) -> dict[str, int]:
        """Frames in each part."""
        return {"recent": len(self._recent), "memory": len(self._memory)}

    @property
    def class_counts(self) -> NDArray[np.int64]:
        """(T, S, 2) known labels of each class over all frames kept: negatives, positives."""
        return self._counts.copy()

    # --- what comes in

    def add(
        self,
        frame_id: int,
        picture: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
    ) -> None:
        """Take in a frame: picture (H, W, C), labels (T, S), weight (T, S). ValueError if the id is here already."""
        if frame_id in self._slots:
            raise ValueError(f"replay buffer: frame {frame_id} is here already; use update() for its labels")
        if len(self._recent) >= self.settings.recent_frames:
            self._retire(self._recent.popleft())
        slot = self._free.pop()
        self._slots[frame_id] = slot
        self._ids[slot], self._uses[slot] = frame_id, 0
        self._pictures[slot], self._labels[slot], self._weight[slot] = picture, labels, weight
        self._thumbnails.put(slot, picture)
        self._count(slot, 1)
        self._recent.append(slot)

    def update(self, frame_id: int, labels: NDArray[np.int8], weight: NDArray[np.float32]) -> bool:
        """Replace a frame's labels and weights in place; False if the frame is no longer kept."""
        slot = self._slots.get(frame_id)
        if slot is None:
            return False
        self._count(slot, -1)
        self._labels[slot], self._weight[slot] = labels, weight
        self._count(slot, 1)
        return True

    # --- what goes out

    def sample(self, size: int) -> Batch | None:
        """Draw a batch, with replacement; None where no frame has uses left."""
        recent = self._usable(np.fromiter(self._recent, np.int64, len(self._recent)))
        memory = self._usable(np.array(self._memory, np.int64))
        if not len(recent) and not len(memory):
            return None
        from_recent = round(size * self.settings.recent_share)
        if not len(memory):
            from_recent = size
        elif not len(recent):
            from_recent = 0
        drawn = [_draw(self._random, recent, from_recent), _draw(self._random, memory, size - from_recent)]
        slots = np.concatenate(drawn)
        np.add.at(self._uses, slots, 1)
        return Batch(self._pictures[slots], self._labels[slots], self._weight[slots])

    # --- to disk and back

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything, as arrays that `restore` takes back exactly."""
        slots = np.array([*self._recent, *self._memory], np.int64)
        return {
            "pictures": self._pictures[slots],
            "labels": self._labels[slots],
            "weight": self._weight[slots],
            "ids": self._ids[slots],
            "uses": self._uses[slots],
            "recent": np.array([len(self._recent)], np.int64),
            "offered": np.array([self._offered, self.duplicates], np.int64),
        }

    def random_state(self) -> dict[str, Any]:
        """The generator's state, as numpy gives it."""
        return dict(self._random.bit_generator.state)

    def restore(self, state: dict[str, NDArray[Any]], random_state: dict[str, Any]) -> None:
        """Become what `state` and `random_state` were taken from; ValueError where the shapes or the budget differ."""
        count, recent = len(state["ids"]), int(state["recent"][0])
        for name, array in (("pictures", self._pictures), ("labels", self._labels)):
            if state[name].shape[1:] != array.shape[1:]:
                raise ValueError(f"replay buffer: saved {name} are {state[name].shape[1:]}, expected {array.shape[1:]}")
        if count > self.capacity:
            raise ValueError(f"replay buffer: {count} frames were saved, the budget holds {self.capacity}")
        self._slots.clear()
        self._recent.clear()
        self._memory.clear()
        self._place.clear()
        self._counts[:] = 0
        self._free = list(range(self.capacity - 1, count - 1, -1))
        for name, array in (("ids", self._ids), ("uses", self._uses), ("weight", self._weight)):
            array[:count] = state[name]
        self._pictures[:count], self._labels[:count] = state["pictures"], state["labels"]
        for slot in range(count):
            self._slots[int(self._ids[slot])] = slot
            self._thumbnails.put(slot, self._pictures[slot])
            self._count(slot, 1)
            if slot < recent:
                self._recent.append(slot)
            else:
                self._remember(slot)
        self._offered, self.duplicates = (int(n) for n in state["offered"])
        self._random.bit_generator.state = random_state
        self._fit()

    # --- inside

    def _fit(self) -> None:
        """What was saved under other settings may be split otherwise: make room as the settings have it."""
        room = self.capacity - self.settings.recent_frames
        while len(self._memory) > room:
            slot = self._memory.pop()
            del self._place[slot]
            self._replace(slot, np.array(self._memory, np.int64))
        while len(self._recent) > self.settings.recent_frames:
            self._retire(self._recent.popleft())

    def _retire(self, slot: int) -> None:
        """A frame is no longer recent: into memory, in someone's place, or away."""
        self._offered += 1
        room = self.capacity - self.settings.recent_frames
        memory = np.array(self._memory, np.int64)
        if self._thumbnails.repeats(slot, memory, self._labels):
            self.duplicates += 1
            self._forget(slot)
            return
        if len(memory) < room:
            self._remember(slot)
            return
        self._replace(slot, memory)

    def _replace(self, slot: int, memory: NDArray[np.int64]) -> None:
        """The memory is full: someone leaves, by the policy, perhaps the newcomer."""
        view = MemoryView(memory, slot, self._ids, self._labels, self._counts, self._offered)
        leaves = self._policy(view, self._random)
        if leaves != slot:
            at = self._place.pop(leaves)
            last = self._memory.pop()
            if last != leaves:
                self._memory[at], self._place[last] = last, at
            self._remember(slot)
        self._forget(leaves)

    def _remember(self, slot: int) -> None:
        self._place[slot] = len(self._memory)
        self._memory.append(slot)

    def _forget(self, slot: int) -> None:
        self._count(slot, -1)
        del self._slots[int(self._ids[slot])]
        self._free.append(slot)

    def _count(self, slot: int, sign: int) -> None:
        labels = self._labels[slot]
        self._counts[..., 0] += sign * (labels == 0)
        self._counts[..., 1] += sign * (labels == 1)

    def _usable(self, slots: NDArray[np.int64]) -> NDArray[np.int64]:
        return slots[self._uses[slots] < self.settings.max_uses]


def _draw(random: np.random.Generator, slots: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return slots[random.integers(0, len(slots), size)] if size else np.zeros(0, np.int64)


def warn_if_too_large(budget_bytes: int) -> None:
    """Warn before a buffer of so many bytes would outgrow the machine."""
    available = int(psutil.virtual_memory().available)
    if budget_bytes > 0.8 * available:
        _LOG.warning(
            "the replay buffer may grow to %.0f MB, but this machine has %.0f MB free: lower memory.budget_mb, or the "
            "machine will swap or kill the learner",
            budget_bytes / 1e6,
            available / 1e6,
        )
