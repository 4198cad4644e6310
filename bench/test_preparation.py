"""A batch of 64 gathered, augmented and standardised: beside numpy a sample at a time, and beside kornia."""

import kornia.augmentation as kornia
import numpy as np
import torch

from bench.eager import OneByOne
from llrp_online.augment import Augmenter
from llrp_online.configuration import load
from llrp_online.preparation import Preparation
from replay.batch import Batch

BATCH, FRAMES, SHORT_FRAMES = 64, 5000, 500
ROBOT = load("configs/thymio.toml")
MIRROR = ROBOT.mirror()
OUTPUTS = ROBOT.outputs


def with_kornia():
    """Its own flip, noise, grey and gradient over the batch, then the same standardisation; labels follow the flip."""
    settings = ROBOT.augmentation
    flip = kornia.RandomHorizontalFlip(p=settings.flip)
    rest = kornia.AugmentationSequential(
        kornia.RandomGaussianNoise(0.0, settings.noise_deviation, p=settings.noise),
        kornia.RandomGrayscale(p=settings.grey),
        kornia.RandomLinearIllumination(gain=(0.01, settings.shadow_strength), p=settings.shadow),
        data_keys=["input"],
    )
    targets, sensors = torch.from_numpy(MIRROR.targets), torch.from_numpy(MIRROR.sensors)

    def prepare(pictures, labels, weight):
        with torch.inference_mode():
            x = flip(torch.from_numpy(pictures).permute(0, 3, 1, 2).float().div_(255))
            flipped = flip._params["batch_prob"] > 0.5
            labels, weight = torch.from_numpy(labels), torch.from_numpy(weight)
            for array in (labels, weight):
                array[flipped] = array[flipped][:, targets][:, :, sensors]
            x = rest(x)
            deviation, mean = torch.std_mean(x, (1, 2, 3), correction=0, keepdim=True)
            return (x - mean) / deviation.clamp(min=1 / 255), labels, weight

    return prepare


def test_preparation(race, short):
    torch.set_num_threads(1)
    rng, frames = np.random.default_rng(0), SHORT_FRAMES if short else FRAMES
    pictures = rng.integers(0, 256, (frames, *ROBOT.picture_shape), dtype=np.uint8)
    labels = rng.integers(-1, 2, (frames, *OUTPUTS)).astype(np.int8)
    weight = rng.random(labels.shape, np.float32)
    prepare = Preparation(Augmenter(ROBOT.augmentation, MIRROR))
    plain, by_kornia, once = OneByOne(ROBOT), with_kornia(), np.empty((BATCH, *ROBOT.picture_shape), np.float32)

    def drawn():
        return rng.integers(0, frames, BATCH)

    def peer(work):
        return lambda: work(*gathered())

    def gathered():
        rows = drawn()
        return pictures[rows], labels[rows], weight[rows]

    def limit():
        begin = rng.integers(0, frames - BATCH)
        np.copyto(once, pictures[begin : begin + BATCH])

    race(
        "augmentation, gather, standardise, batch 64",
        lambda: prepare(Batch(pictures, labels, weight, drawn()), rng),
        {"numpy, a sample at a time": peer(plain), "kornia": peer(by_kornia)},
        {"numpy, a sample at a time": 10.0, "kornia": 1.0},
        limit=("each picture read and written once", limit),
        rounds=40,
        note=f"{frames:,} frames of {' x '.join(map(str, ROBOT.picture_shape))}, {OUTPUTS[0]} x {OUTPUTS[1]} labels",
    )
