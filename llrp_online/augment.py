"""The paper's four augmentations, over a whole batch at once: flip, noise, grey, soft shadow (section IV-D); colours.

A flip mirrors the world: the picture's columns, what each camera and each sensor sees, and where each target lies.
What is drawn at random is drawn first, for all pictures, and only then applied: so the compiled form, in
`llrp_online.preparation`, applies the same. Colours are turned last, in pictures
that are standardised already.
"""

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.learning import Augmentation
from llrp_online.mirror import Mirror

FULL_SCALE = 255.0
# ITU-R BT.601: how bright red, green and blue look.
LUMA = (0.299, 0.587, 0.114)
#: Noise is read from a table of so many normals, or of some pictures' worth if they are larger.
_GRAINS, _PICTURES = 1 << 20, 4


class Augmented(NamedTuple):
    """What the augmentation returns; three new arrays.

    Attributes:
        pictures: (N, H, W, C) float32 on the scale of 0 to 255, not clipped to it.
        labels: (N, T, S) int8.
        weight: (N, T, S) float32.
    """

    pictures: NDArray[np.float32]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class Draw(NamedTuple):
    """What happens to each of N pictures.

    Attributes:
        flip: (N,) bool.
        grain: (N,) float32, by what the table of normals is multiplied; 0: no noise.
        grain_from: (N,) int64, where in the table the picture's noise begins.
        grey: (N,) bool.
        right, down: (N,) float32, by how much the shadow brightens the picture from side to side, from top to bottom.
    """

    flip: NDArray[np.bool_]
    grain: NDArray[np.float32]
    grain_from: NDArray[np.int64]
    grey: NDArray[np.bool_]
    right: NDArray[np.float32]
    down: NDArray[np.float32]


class Augmenter:
    """Flip, noise, grey and shadow, each with its probability, drawn anew for every picture.

    Noise is Gaussian, from a table of normals that is the same in every run: drawn at random are where a picture begins
    to read it, and the sign. Normals drawn anew for each pixel would take longer than all the rest.

    Args:
        settings: probabilities and strengths.
        mirror: the rig's; None if it has none, and then flip must be 0.

    >>> one = np.zeros(1, np.int64)
    >>> augment = Augmenter(Augmentation(flip=1, noise=0, grey=0, shadow=0), Mirror(one, np.array([1, 0]), one))
    >>> picture = np.array([[[[9, 9, 9], [0, 0, 0]]]], np.uint8)
    >>> labels = np.array([[[1, 0]]], np.int8)
    >>> flipped = augment(picture, labels, np.ones((1, 1, 2), np.float32), np.random.default_rng(0))
    >>> flipped.pictures[0, 0, :, 0], flipped.labels
    (array([0., 9.], dtype=float32), array([[[0, 1]]], dtype=int8))
    """

    def __init__(
        self,
        settings: Augmentation,
        mirror: Mirror | None,
    ) -> None:
        self._settings, self.mirror = settings, mirror
        if mirror is None and settings.flip > 0:
            raise ValueError(
                f"flip = {settings.flip:g}, but the rig has no mirror image: expected who replaces each sensor, target "
                "and camera, got None; set flip = 0"
            )

    def draw(self, count: int, values: int, rng: np.random.Generator) -> Draw:
        """What will happen to `count` pictures of so many `values` (H * W * C); all randomness comes from `rng`."""
        settings = self._settings
        flip, noise, grey, shadow = (
            rng.random(count) < probability
            for probability in (settings.flip, settings.noise, settings.grey, settings.shadow)
        )
        deviation = np.where(rng.random(count) < 0.5, -FULL_SCALE, FULL_SCALE) * settings.noise_deviation
        grain_from = rng.integers(0, len(grains(values)) - values + 1, count)
        depth = rng.random(count) * settings.shadow_strength * FULL_SCALE * shadow
        direction_rad = rng.random(count) * 2 * np.pi
        right, down = np.cos(direction_rad), np.sin(direction_rad)
        # The darkest and the brightest corner are `depth` apart.
        slope = depth / (np.abs(right) + np.abs(down))
        return Draw(
            flip,
            (noise * deviation).astype(np.float32),
            grain_from,
            grey,
            (slope * right).astype(np.float32),
            (slope * down).astype(np.float32),
        )

    def __call__(
        self,
        pictures: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
        rng: np.random.Generator,
    ) -> Augmented:
        """Augment (N, H, W, C) uint8 pictures with (N, T, S) labels and weights; all randomness comes from `rng`."""
        values = int(np.prod(pictures.shape[1:]))
        draw = self.draw(len(pictures), values, rng)
        result = Augmented(pictures.astype(np.float32), labels.copy(), weight.copy())
        if draw.flip.any():
            self._mirror(result, draw.flip)
        for picture, grain, begin in zip(result.pictures, draw.grain, draw.grain_from, strict=True):
            if grain:
                picture += grain * grains(values)[begin : begin + values].reshape(picture.shape)
        cameras = result.pictures[draw.grey].reshape(draw.grey.sum(), *pictures.shape[1:3], pictures.shape[3] // 3, 3)
        result.pictures[draw.grey] = np.repeat(cameras @ np.array(LUMA, np.float32), 3, axis=-1)
        _, height, width, _ = pictures.shape
        result.pictures[:] += np.outer(draw.right, ramp(width))[:, None, :, None]
        result.pictures[:] += np.outer(draw.down, ramp(height))[:, :, None, None]
        return result

    def turn_colours(self, pictures: NDArray[np.float32], rng: np.random.Generator) -> None:
        """Give some pictures other colours, in place: (N, H, W, C) float32, standardised, so that grey is near zero.

        A picture's energy stays, and so does what one pixel's colour is to another's; all its cameras turn alike.
        """
        if self._settings.colour:
            chosen, turn = turned(len(pictures), self._settings.colour, rng)
            pixels = pictures.reshape(len(pictures), -1, 3)
            for picture, turns in zip(chosen, turn, strict=True):
                # Three sums over whole rows: a product of so narrow matrices would take several times as long.
                red, green, blue = pixels[picture].T.copy()
                for colour, (of_red, of_green, of_blue) in enumerate(turns.T):
                    pixels[picture, :, colour] = of_red * red + of_green * green + of_blue * blue

    def _mirror(self, result: Augmented, flip: NDArray[np.bool_]) -> None:
        assert self.mirror is not None
        targets, sensors = self.mirror.targets[:, None], self.mirror.sensors
        result.pictures[flip] = result.pictures[flip][:, :, ::-1, self.mirror.channels]
        for array in (result.labels, result.weight):
            array[flip] = array[flip][:, targets, sensors]


def turned(count: int, probability: float, rng: np.random.Generator) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Which of `count` pictures get other colours, and how: (K,) indices and (K, 3, 3) orthogonal matrices.

    Every turn or mirror image of the space of red, green and blue is as likely as any other.
    """
    normals = rng.standard_normal((count, 3, 3))
    chosen = np.flatnonzero(rng.random(count) < probability)
    turn, triangle = np.linalg.qr(normals[chosen])
    turn *= np.sign(np.diagonal(triangle, axis1=1, axis2=2))[:, None, :]
    return chosen, turn.astype(np.float32)


def grains(values: int) -> NDArray[np.float32]:
    """The table of normals for pictures of so many values, the same in every run."""
    return _normals(max(_GRAINS, _PICTURES * values))


@functools.cache
def _normals(count: int) -> NDArray[np.float32]:
    return np.random.default_rng(0).standard_normal(count, np.float32)


def ramp(size: int) -> NDArray[np.float32]:
    """(size,) from -1/2 to 1/2."""
    return np.linspace(-0.5, 0.5, size, dtype=np.float32)
