"""The replay buffer: pictures with partly known labels, kept under a hard byte budget and drawn in batches.

The newest frames are all kept (`recent`); a frame that is no longer recent is offered to the `memory`, which decides
who stays by its policy (`replay.policies`). A batch is drawn part from each. Labels that improve later are updated in
place. Mask-aware: -1 is unknown throughout, and the counts that balance the memory are of known labels only.
"""

import logging
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from replay import duplicates
from replay.batch import Batch
from replay.buffer_kernels import KERNELS
from replay.drawing import Drawing
from replay.duplicates import Newest
from replay.frame_store import FrameStore, bytes_of_frame
from replay.policies import POLICIES, MemoryView

_LOG = logging.getLogger(__name__)
#: What is kept of a frame beside its own bytes: its id, its place in memory, what drawing needs; and an entry of a dict
#: with its two numbers, as CPython has them.
_ENTRY_BYTES = 8 + 8 + Drawing.ROW_BYTES + 128


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


class ReplayBuffer:
    """Frames by id, drawn half from the newest and half from memory.

    Nothing it does takes longer for holding more.

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
        self.frame_bytes = bytes_of_frame(picture_shape, label_shape) + _ENTRY_BYTES
        self.capacity = settings.budget_bytes // self.frame_bytes
        if self.capacity < 2 * settings.recent_frames:
            raise ValueError(
                f"replay buffer: a budget of {settings.budget_bytes / 1e6:g} MB holds {self.capacity} frames of "
                f"{self.frame_bytes} bytes, but memory.recent_frames = {settings.recent_frames} alone want half of it; "
                f"expected at least {2 * settings.recent_frames * self.frame_bytes / 1e6:.1f} MB: "
                "raise memory.budget_mb or lower memory.recent_frames"
            )
        warn_if_too_large(self.capacity * self.frame_bytes)
        try:
            self._frames = FrameStore(self.capacity, picture_shape, label_shape)
        except MemoryError:
            raise ValueError(
                f"replay buffer: no room for {settings.budget_bytes / 1e6:g} MB here: lower memory.budget_mb"
            ) from None
        self._ids = np.full(self.capacity, -1, np.int64)
        self._slots: dict[int, int] = {}
        self._left: list[int] = []  # slots that are free again
        self._recent: deque[int] = deque()
        self._memory = np.zeros(self.capacity, np.int64)  # slots, in the first `_remembered` places
        self._remembered = 0
        self._drawing = Drawing(self.capacity, settings.recent_share, settings.max_uses)
        self._newest = Newest(settings.duplicate_distance, self._ids, self._frames.labels)
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
        return {"recent": len(self._recent), "memory": self._remembered}

    @property
    def class_counts(self) -> NDArray[np.int64]:
        """(T, S, 2) known labels of each class over all frames kept: negatives, positives."""
        return self._frames.class_counts

    def glance(self, most: int) -> tuple[NDArray[np.int64], Batch] | None:
        """Ids (N,) and the frames themselves, spread evenly over all that is kept, oldest memory first; None of none.

        The batch is good until the next `add`.
        """
        slots = np.concatenate([self._memory[: self._remembered], np.array(self._recent, np.int64)])
        if not len(slots):
            return None
        some = slots[np.linspace(0, len(slots) - 1, min(most, len(slots))).astype(np.int64)]
        return self._ids[some], self._frames.batch(some)

    # --- what comes in

    def add(
        self,
        frame_id: int,
        picture: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
    ) -> None:
        """Take in a frame: picture (H, W, C), labels (T, S), weight (T, S). ValueError if the id is here already.

        An id is not negative.
        """
        if frame_id in self._slots:
            raise ValueError(f"replay buffer: frame {frame_id} is here already; use update() for its labels")
        if len(self._recent) >= self.settings.recent_frames:
            self._retire(self._recent.popleft())
        slot = self._left.pop() if self._left else len(self._slots)
        self._slots[frame_id] = slot
        self._ids[slot] = frame_id
        self._frames.put(slot, picture, labels, weight)
        self._recent.append(slot)
        self._drawing.enter(slot)

    def update(self, frame_id: int, labels: NDArray[np.int8], weight: NDArray[np.float32]) -> bool:
        """Replace a frame's labels and weights, (T, S) each, in place; False if the frame is no longer kept."""
        return bool(self.update_many([frame_id], labels[None], weight[None])[0])

    def update_many(
        self, frame_ids: Sequence[int], labels: NDArray[np.int8], weight: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Replace the labels and weights of many frames in place; of an id given twice the last counts.

        Args:
            frame_ids: M of them.
            labels: (M, T, S) int8.
            weight: (M, T, S) float32.

        Returns:
            (M,) bool: is the frame kept? Those that are not are passed over.
        """
        slots = np.array([self._slots.get(frame_id, -1) for frame_id in frame_ids], np.int64)
        self._frames.replace(slots, labels, weight)
        return slots >= 0

    # --- what goes out

    def sample(self, size: int) -> Batch | None:
        """Draw a batch, with replacement; None where no frame has uses left. It is good until the next `add`."""
        slots = self._drawing.draw(self._random, size)
        return None if slots is None else self._frames.batch(slots)

    # --- to disk and back

    def state(self) -> dict[str, NDArray[Any]]:
        """All but the frames themselves, as arrays for `restore`; the frames come from `shards`."""
        slots = self._in_order()
        return {
            "ids": self._ids[slots],
            "recent": np.array([len(self._recent)], np.int64),
            "offered": np.array([self._offered, self.duplicates], np.int64),
            **self._drawing.state(slots),
            **self._newest.state(),
        }

    def shards(self) -> Iterator[dict[str, NDArray[Any]]]:
        """The frames, a part at a time, as arrays for `restore`: pictures, labels and weight in the order of `ids`."""
        return self._frames.shards(self._in_order())

    def random_state(self) -> dict[str, Any]:
        """The generator's state, as numpy gives it."""
        return dict(self._random.bit_generator.state)

    def restore(
        self,
        state: Mapping[str, NDArray[Any]],
        shards: Iterable[Mapping[str, NDArray[Any]]],
        random_state: dict[str, Any],
    ) -> None:
        """Become what these were taken from; ValueError where the shapes or the budget differ."""
        count = len(state["ids"])
        if count > self.capacity:
            raise ValueError(f"replay buffer: {count} frames were saved, the budget holds {self.capacity}")
        self._left.clear()
        self._recent.clear()
        self._ids[:] = -1
        self._policy = POLICIES[self.settings.policy](self.settings.positives_floor)
        self._frames.fill(shards, count)
        self._ids[:count] = state["ids"]
        self._slots = dict(zip(state["ids"].tolist(), range(count), strict=True))
        recent = int(state["recent"][0])
        self._recent.extend(range(recent))
        self._remembered = count - recent
        self._memory[: self._remembered] = np.arange(recent, count)
        self._drawing.restore(state, recent)
        self._newest.restore(state, self._slots)
        self._offered, self.duplicates = (int(n) for n in state["offered"])
        self._random.bit_generator.state = random_state
        self._fit()

    # --- inside

    def _in_order(self) -> NDArray[np.int64]:
        """The slots in use: the recent frames, oldest first, then those in memory."""
        return np.concatenate([np.array(self._recent, np.int64), self._memory[: self._remembered]])

    def _fit(self) -> None:
        """What was saved under other settings may be split otherwise: make room as the settings have it."""
        room = self.capacity - self.settings.recent_frames
        while self._remembered > room:
            self._remembered -= 1
            self._replace(int(self._memory[self._remembered]))
        while len(self._recent) > self.settings.recent_frames:
            self._retire(self._recent.popleft())

    def _retire(self, slot: int) -> None:
        """A frame is no longer recent: into memory, in someone's place, or away."""
        self._offered += 1
        kernels = KERNELS.get()
        thumbnail = (duplicates.thumbnail if kernels is None else kernels.thumbnail)(self._frames.pictures[slot])
        if self._newest.repeated_by(slot, thumbnail):
            self.duplicates += 1
            self._forget(slot)
            return
        self._drawing.retire(slot)
        if self._remembered < self.capacity - self.settings.recent_frames:
            self._memory[self._remembered] = slot
            self._remembered += 1
        else:
            self._replace(slot)
        if self._ids[slot] >= 0:
            self._newest.remember(slot, thumbnail)

    def _replace(self, slot: int) -> None:
        """The memory is full: someone leaves, by the policy, perhaps the newcomer."""
        memory = self._memory[: self._remembered]
        view = MemoryView(memory, slot, self._ids, self._frames.labels, self._frames.counts, self._offered)
        place = self._policy(view, self._random)
        if place is None:
            self._forget(slot)
        else:
            self._forget(int(memory[place]))
            memory[place] = slot

    def _forget(self, slot: int) -> None:
        self._frames.drop(slot)
        self._drawing.leave(slot)
        del self._slots[int(self._ids[slot])]
        self._ids[slot] = -1
        self._left.append(slot)


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
