"""The paper's four augmentations, over a whole batch at once: flip, noise, grey, soft shadow (section IV-D).

A flip mirrors the world: the picture's columns, what each camera and each sensor sees, and where each target lies.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.learning import Augmentation

FULL_SCALE = 255.0
# ITU-R BT.601: how bright red, green and blue look.
_LUMA = np.array([0.299, 0.587, 0.114], np.float32)


class Batch(NamedTuple):
    """What the augmentation returns; three new arrays.

    Attributes:
        pictures: (N, H, W, C) float32 on the scale of 0 to 255, not clipped to it: ready for `network.standardise`.
        labels: (N, T, S) int8.
        weight: (N, T, S) float32.
    """

    pictures: NDArray[np.float32]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class Augmenter:
    """Flip, noise, grey and shadow, each with its probability, drawn anew for every picture.

    Args:
        settings: probabilities and strengths.
        sensor_swap: (S,) which sensor replaces each in a flipped world.
        target_swap: (T,) which target replaces each.
        camera_swap: (C / 3,) which camera replaces each.

    A rig without a mirror image has None among the swaps, and then flip must be 0.

    >>> one = np.zeros(1, np.int64)
    >>> augment = Augmenter(Augmentation(flip=1, noise=0, grey=0, shadow=0), np.array([1, 0]), one, one)
    >>> picture = np.array([[[[9, 9, 9], [0, 0, 0]]]], np.uint8)
    >>> labels = np.array([[[1, 0]]], np.int8)
    >>> flipped = augment(picture, labels, np.ones((1, 1, 2), np.float32), np.random.default_rng(0))
    >>> flipped.pictures[0, 0, :, 0], flipped.labels
    (array([0., 9.], dtype=float32), array([[[0, 1]]], dtype=int8))
    """

    def __init__(
        self,
        settings: Augmentation,
        sensor_swap: NDArray[np.int64] | None,
        target_swap: NDArray[np.int64] | None,
        camera_swap: NDArray[np.int64] | None,
    ) -> None:
        self._settings = settings
        self._label_swap: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
        self._channel_swap: NDArray[np.int64] | None = None
        if sensor_swap is not None and target_swap is not None and camera_swap is not None:
            self._label_swap = target_swap[:, None], sensor_swap[None, :]
            self._channel_swap = (3 * camera_swap[:, None] + np.arange(3)).ravel()
        elif settings.flip > 0:
            raise ValueError(
                f"flip = {settings.flip:g}, but the rig has no mirror image: expected a swap for sensors, targets and "
                f"cameras, got {sensor_swap}, {target_swap}, {camera_swap}"
            )

    def __call__(
        self,
        pictures: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
        rng: np.random.Generator,
    ) -> Batch:
        """Augment (N, H, W, C) uint8 pictures with (N, T, S) labels and weights; all randomness comes from `rng`."""
        settings, count = self._settings, len(pictures)
        flip, noise, grey, shadow = (
            np.flatnonzero(rng.random(count) < probability)
            for probability in (settings.flip, settings.noise, settings.grey, settings.shadow)
        )
        batch = Batch(pictures.astype(np.float32), labels.copy(), weight.copy())
        if len(flip):
            self._mirror(batch, pictures, flip)
        if len(noise):
            grain = rng.standard_normal((len(noise), *pictures.shape[1:]), np.float32)
            grain *= np.float32(settings.noise_deviation * FULL_SCALE)
            batch.pictures[noise] += grain
        if len(grey):
            cameras = batch.pictures[grey].reshape(len(grey), *pictures.shape[1:3], -1, 3)
            luma = np.repeat(cameras @ _LUMA, 3, axis=-1)
            batch.pictures[grey] = luma
        if len(shadow):
            depth = np.zeros(count)
            depth[shadow] = rng.random(len(shadow)) * settings.shadow_strength * FULL_SCALE
            _shade(batch.pictures, depth, rng.random(count) * 2 * np.pi)
        return batch

    def _mirror(self, batch: Batch, pictures: NDArray[np.uint8], flip: NDArray[np.intp]) -> None:
        mirrored = pictures[flip, :, ::-1]
        if self._channel_swap is not None and len(self._channel_swap) > 3:
            mirrored = mirrored[..., self._channel_swap]
        batch.pictures[flip] = mirrored
        assert self._label_swap is not None
        targets, sensors = self._label_swap
        batch.labels[flip] = batch.labels[flip][:, targets, sensors]
        batch.weight[flip] = batch.weight[flip][:, targets, sensors]


def _shade(pictures: NDArray[np.float32], depth: NDArray[np.float64], direction_rad: NDArray[np.float64]) -> None:
    """Add to each picture a plane of mean zero, whose darkest and brightest corners are `depth` (N,) apart."""
    count, height, width, channels = pictures.shape
    right, down = np.cos(direction_rad), np.sin(direction_rad)
    reach = depth / (np.abs(right) + np.abs(down))
    x = np.outer(reach * right, np.linspace(-0.5, 0.5, width)).astype(np.float32)
    y = np.outer(reach * down, np.linspace(-0.5, 0.5, height)).astype(np.float32)
    # Rows of width x channels numbers, added to in long runs: several times faster than broadcasting over channels.
    rows = pictures.reshape(count, height, width * channels)
    rows += np.repeat(x, channels, axis=1)[:, None, :]
    rows += y[:, :, None]
