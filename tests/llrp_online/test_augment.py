import numpy as np
import pytest

from llrp_online.augment import Augmenter, turned
from llrp_online.configuration.learning import Augmentation
from llrp_online.mirror import Mirror
from replay.targets import Targets

OFF = {"flip": 0.0, "noise": 0.0, "grey": 0.0, "shadow": 0.0}
GRID = Targets.grid([0.0, 1.0, 0.5], [-1.0, 1.0, 0.5])
CAMERA_SWAP = np.array([1, 0, 2])  # left, right, ahead
SENSOR_SWAP = np.array([2, 1, 0])  # left, ahead, right
SENSOR_ANGLES_RAD = np.array([0.7, 0.0, -0.7])


def augmenter(**probabilities):
    return Augmenter(Augmentation(**{**OFF, **probabilities}), Mirror(GRID.mirror(), SENSOR_SWAP, CAMERA_SWAP))


def batch(count=6, seed=0):
    rng = np.random.default_rng(seed)
    shape = (count, len(GRID), 3)
    return (
        rng.integers(0, 256, (count, 8, 10, 9), dtype=np.uint8),
        rng.integers(-1, 2, shape).astype(np.int8),
        rng.random(shape, np.float32),
    )


def test_nothing_is_changed_with_probability_zero():
    given = batch()
    result = augmenter()(*given, np.random.default_rng(0))
    for before, after in zip(given, result, strict=True):
        assert np.array_equal(before, after)
        assert not np.shares_memory(before, after)


@pytest.mark.parametrize("cameras", [1, 3])
def test_turned_colours_keep_what_pixels_are_to_each_other(cameras):
    rng = np.random.default_rng(0)
    pictures = rng.standard_normal((200, 4, 5, 3 * cameras)).astype(np.float32)
    kept = pictures.copy()
    Augmenter(Augmentation(**{**OFF, "colour": 0.5}), None).turn_colours(pictures, rng)
    changed = (pictures != kept).any((1, 2, 3))
    assert 70 < changed.sum() < 130
    before, after = (array.reshape(200, -1, 3) for array in (kept, pictures))
    products = [array @ array.transpose(0, 2, 1) for array in (before, after)]
    np.testing.assert_allclose(*products, atol=1e-4)


def test_every_turn_of_the_colours_is_as_likely():
    chosen, turn = turned(4000, 1.0, np.random.default_rng(0))
    assert len(chosen) == 4000
    np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.broadcast_to(np.eye(3), turn.shape), atol=1e-5)
    assert np.abs(turn.mean(0)).max() < 0.05
    assert abs(np.linalg.det(turn).mean()) < 0.05


def test_a_seed_repeats_and_inputs_stay():
    given = batch()
    kept = [array.copy() for array in given]
    augment = augmenter(flip=0.5, noise=0.5, grey=0.5, shadow=0.5)
    first, again, other = (augment(*given, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.pictures, other.pictures)
    assert all(np.array_equal(a, b) for a, b in zip(given, kept, strict=True))


def test_mirroring_twice_is_the_identity():
    given = batch()
    flip = augmenter(flip=1.0)
    once = flip(*given, np.random.default_rng(0))
    twice = flip(once.pictures.astype(np.uint8), once.labels, once.weight, np.random.default_rng(0))
    assert all(np.array_equal(a, b) for a, b in zip(given, twice, strict=True))
    assert not np.array_equal(once.labels, given[1])


def felt(obstacles):
    """(T, S) bits in a world of points: is one within 0.4 m of what the sensor feels, 0.5 m ahead of it?"""
    at = GRID.poses[:, None, :]
    heading_rad = at[..., 2] + SENSOR_ANGLES_RAD
    x, y = at[..., 0] + 0.5 * np.cos(heading_rad), at[..., 1] + 0.5 * np.sin(heading_rad)
    apart = np.hypot(x[..., None] - obstacles[:, 0], y[..., None] - obstacles[:, 1])
    return (apart < 0.4).any(-1).astype(np.int8)


def seen(obstacles):
    """(1, 1, 36, 9) picture: each camera is one row of 36 directions that shows the nearest obstacle's distance."""
    row = np.zeros((1, 1, 36, 9), np.uint8)
    for camera, axis_rad in enumerate([0.9, -0.9, 0.0]):
        for x, y in obstacles:
            column = int((axis_rad - np.arctan2(y, x)) // 0.05) + 18  # left is column 0
            if 0 <= column < 36:
                row[0, 0, column, 3 * camera : 3 * camera + 3] = [100 * np.hypot(x, y), 50, camera == 2]
    return row


def test_a_flipped_frame_is_a_frame_of_the_mirrored_world():
    obstacles = np.array([[0.6, 0.93], [1.1, -0.42], [1.4, 0.07]])
    mirrored = obstacles * [1, -1]
    weight = np.ones((1, len(GRID), 3), np.float32)
    flipped = augmenter(flip=1.0)(seen(obstacles), felt(obstacles)[None], weight, np.random.default_rng(0))
    assert 0 < felt(obstacles).mean() < 1
    assert not np.array_equal(felt(obstacles), felt(mirrored))
    assert np.array_equal(flipped.labels[0], felt(mirrored))
    assert np.array_equal(flipped.pictures, seen(mirrored))


def test_weights_go_with_their_labels():
    pictures, labels, _ = batch()
    weight = (labels + 2).astype(np.float32)
    flipped = augmenter(flip=1.0)(pictures, labels, weight, np.random.default_rng(0))
    assert np.array_equal(flipped.weight, flipped.labels + 2)


def test_noise_has_the_deviation_asked_for():
    pictures, labels, weight = batch(100)
    noisy = augmenter(noise=1.0, noise_deviation=0.02)(pictures, labels, weight, np.random.default_rng(0))
    grain = noisy.pictures - pictures
    assert grain.std() == pytest.approx(0.02 * 255, rel=0.02)
    assert abs(grain.mean()) < 0.1


def test_grey_pictures_have_no_colour_within_a_camera():
    pictures, labels, weight = batch()
    grey = augmenter(grey=1.0)(pictures, labels, weight, np.random.default_rng(0)).pictures
    for camera in range(3):
        rgb = pictures[..., 3 * camera : 3 * camera + 3].astype(np.float64)
        expected = rgb @ [0.299, 0.587, 0.114]
        for channel in range(3):
            np.testing.assert_allclose(grey[..., 3 * camera + channel], expected, rtol=1e-5, atol=1e-3)


def test_a_shadow_is_a_plane_no_stronger_than_asked_for():
    pictures, labels, weight = batch(200)
    shaded = augmenter(shadow=1.0, shadow_strength=0.3)(pictures, labels, weight, np.random.default_rng(0)).pictures
    shadow = shaded - pictures
    assert np.abs(shadow - shadow[..., :1]).max() < 1e-3  # the same in every channel
    plane = shadow[..., 0]
    assert np.abs(np.diff(plane, 2, axis=1)).max() < 1e-3
    assert np.abs(np.diff(plane, 2, axis=2)).max() < 1e-3
    assert np.abs(plane.mean((1, 2))).max() < 1e-3
    depth = np.ptp(plane.reshape(200, -1), axis=1)
    assert 0.25 * 255 < depth.max() <= 0.3 * 255 + 1e-3
    assert depth.min() < 0.05 * 255
    downward, rightward = plane[:, -1, 0] - plane[:, 0, 0], plane[:, 0, -1] - plane[:, 0, 0]
    assert all((side > 0).any() and (side < 0).any() for side in (downward, rightward))


def test_each_happens_as_often_as_asked_for():
    pictures, labels, weight = batch(400)
    for name in OFF:
        changed = augmenter(**{name: 0.25})(pictures, labels, weight, np.random.default_rng(0)).pictures != pictures
        assert changed.any((1, 2, 3)).mean() == pytest.approx(0.25, abs=0.06)


def test_a_rig_without_mirror_image_may_be_augmented_but_not_flipped():
    given = batch()
    no_mirror = Augmenter(Augmentation(flip=0), None)
    assert no_mirror(*given, np.random.default_rng(0)).pictures.shape == given[0].shape
    with pytest.raises(ValueError, match=r"flip = 0\.5, but the rig has no mirror image"):
        Augmenter(Augmentation(flip=0.5), None)
