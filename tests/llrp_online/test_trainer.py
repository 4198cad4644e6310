import json
from contextlib import nullcontext

import numpy as np
import pytest
import torch

from llrp_online import checkpoint
from llrp_online.trainer import Trainer
from replay.batch import Batch
from replay.compiling import plainly
from tests.llrp_online.worlds import SIDE, configuration, picture

EVEN = np.ones((3, 2, 2), np.int64)


def batch(seed=0, size=16):
    """Bright means near: each label follows from the mean of its half of the picture."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 0.9, size)
    pictures = np.stack([picture(x_m, rng) for x_m in places])
    labels = np.stack([[[x_m > 0.3 * (target + 1)] * 2 for target in range(3)] for x_m in places]).astype(np.int8)
    return Batch(pictures, labels, np.ones(labels.shape, np.float32))


def same(weights, others):
    return all(np.array_equal(weights[name], others[name]) for name in weights)


@pytest.mark.parametrize("preset", ["online", "paper"])
@pytest.mark.parametrize("loss", ["cross_entropy", "paper"])
def test_the_loss_falls(preset, loss):
    trainer = Trainer(configuration(network={"preset": preset}, training={"loss": loss}))
    losses = [trainer.step(batch(step), EVEN) for step in range(120)]
    assert np.mean(losses[-10:]) < 0.5 * np.mean(losses[:10])
    assert trainer.steps == 120


def test_the_average_follows_closely_first_and_then_ever_more_calmly():
    trainer = Trainer(configuration(training={"average": 0.75, "learning_rate": 1e-2}))
    expected, shares = trainer.weights()["dense.weight"].astype(np.float64), []
    for step in range(1, 41):
        trainer.step(batch(step), EVEN)
        shares.append(1 - min(0.75, step / (step + 9)))
        expected += shares[-1] * (trainer.network.weights()["dense.weight"] - expected)
        np.testing.assert_allclose(trainer.weights()["dense.weight"], expected, atol=1e-6)
    assert (shares[0], shares[-1]) == (0.9, 0.25)
    assert not np.allclose(trainer.network.weights()["dense.weight"], expected, atol=1e-4)


def test_same_seed_same_weights_and_another_seed_others():
    def trained(seed):
        trainer = Trainer(configuration(training={"seed": seed}))
        for step in range(5):
            trainer.step(batch(step), EVEN)
        return trainer.weights()

    assert same(trained(3), trained(3))
    assert not same(trained(3), trained(4))


def test_nobody_elses_random_numbers_are_touched_or_used():
    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002
    before = torch.get_rng_state(), np.random.get_state()[1].copy()  # noqa: NPY002
    first = Trainer(configuration())
    first.step(batch(), EVEN)
    assert torch.equal(torch.get_rng_state(), before[0])
    assert np.array_equal(np.random.get_state()[1], before[1])  # noqa: NPY002
    torch.manual_seed(99)
    second = Trainer(configuration())
    second.step(batch(), EVEN)
    assert same(first.weights(), second.weights())


def restored(trainer, tmp_path):
    """A trainer of another seed that became this one, by way of the disk."""
    arrays, values = trainer.state()
    checkpoint.save(tmp_path / "c", {"weights": trainer.weights(), "training": arrays}, {"training": values})
    tensors, manifest = checkpoint.load(tmp_path / "c")
    twin = Trainer(configuration(training={"seed": 77}))
    twin.step(batch(9), EVEN)
    twin.restore(tensors["training"], json.loads(json.dumps(manifest["training"])))
    return twin


@pytest.mark.parametrize("before", [0, 1, 7])
def test_restored_it_goes_on_bit_for_bit(tmp_path, before):
    trainer = Trainer(configuration())
    for step in range(before):
        trainer.step(batch(step), EVEN)
    twin = restored(trainer, tmp_path)
    assert twin.steps == before
    assert same(twin.weights(), trainer.weights())
    for step in range(5):
        # The loss tells dropout and augmentation at once, the weights the optimiser's moments.
        assert twin.step(batch(100 + step), EVEN) == trainer.step(batch(100 + step), EVEN)
        assert same(twin.weights(), trainer.weights())
        assert same(twin.network.weights(), trainer.network.weights())


@pytest.mark.parametrize("first", ["compiled", "plain"])
def test_what_was_trained_compiled_goes_on_plain_and_the_other_way_round(tmp_path, first):
    forms = {"compiled": nullcontext, "plain": plainly}
    now, then = forms.pop(first), next(iter(forms.values()))
    one, twin = Trainer(configuration()), Trainer(configuration())
    with now():
        for step in range(3):
            one.step(batch(step), EVEN)
        arrays, values = one.state()
        checkpoint.save(tmp_path / "c", {"weights": one.weights(), "training": arrays}, {"training": values})
        expected = one.judge(one.weights(), batch(9)), one.step(batch(9), EVEN)
    with then():
        tensors, manifest = checkpoint.load(tmp_path / "c")
        twin.restore(tensors["training"], manifest["training"])
        assert same(twin.weights(), tensors["weights"])
        assert (twin.judge(twin.weights(), batch(9)), twin.step(batch(9), EVEN)) == pytest.approx(expected, rel=1e-5)


def test_unknown_labels_teach_nothing():
    def trained(change):
        trainer = Trainer(configuration())
        for step in range(3):
            one = batch(step)
            one.labels[:8, 1:] = -1
            one.labels[:, 2] = -1
            change(one)
            trainer.step(one, EVEN)
        return trainer.network.weights()

    def nothing(_):
        pass

    def weigh(one):
        one.weight[one.labels < 0] = 0.123

    def know(one):
        one.labels[0, 1] = 1

    plain = trained(nothing)
    assert same(plain, trained(weigh))
    assert not same(plain, trained(know))  # so the comparison above can fail
    # The outputs of a target that nothing is known of stay as they were drawn.
    fresh = Trainer(configuration()).network.weights()
    for name in ("outputs.weight", "outputs.bias"):
        np.testing.assert_array_equal(plain[name].reshape(3, 2, -1)[2], fresh[name].reshape(3, 2, -1)[2])
        assert not np.array_equal(plain[name].reshape(3, 2, -1)[1], fresh[name].reshape(3, 2, -1)[1])


def test_rare_positives_weigh_more():
    rare = np.stack([np.full((3, 2), 90), np.full((3, 2), 10)], -1)

    def trained(maximum):
        trainer = Trainer(configuration(training={"positive_weight_max": maximum}))
        for step in range(60):
            trainer.step(batch(step), rare)
        return trainer

    one = batch(500, size=64)
    few = Batch(one.pictures, np.where(one.labels == 1, np.int8(1), np.int8(-1)), one.weight)
    balanced, plain = trained(4.0), trained(1.0)
    assert balanced.judge(balanced.weights(), few) < plain.judge(plain.weights(), few)


def test_become_begins_anew_from_the_weights():
    teacher, pupil = Trainer(configuration()), Trainer(configuration(training={"seed": 5}))
    for step in range(10):
        teacher.step(batch(step), EVEN)
        pupil.step(batch(step), EVEN)
    weights = teacher.weights()
    pupil.become(weights)
    assert same(pupil.weights(), weights)
    assert same(pupil.network.weights(), weights)
    assert not any(
        name.startswith("exp_avg") for name in pupil.state()[0]
    )  # the optimiser's memory was of the old ones
    pupil.step(batch(), EVEN)
    assert same(teacher.weights(), weights)  # the pupil has a copy
    with pytest.raises(RuntimeError, match=r"dense\.bias"):
        pupil.become({**weights, "dense.bias": np.zeros(3, np.float32)})


def test_what_it_hands_out_is_a_copy():
    trainer = Trainer(configuration())
    arrays, _ = trainer.state()
    weights = trainer.weights()
    kept = {name: array.copy() for name, array in weights.items()}
    state = {name: array.copy() for name, array in arrays.items()}
    trainer.step(batch(), EVEN)
    assert same(weights, kept)
    assert same(arrays, state)
    assert not same(trainer.weights(), kept)
    assert not any(array.flags.writeable for array in weights.values())


def test_the_judge_is_the_mean_log_loss_of_what_is_known():
    trainer = Trainer(configuration())
    for step in range(20):
        trainer.step(batch(step), EVEN)
    weights, one = trainer.weights(), batch(500)
    before = trainer.network.weights()
    whole = trainer.judge(weights, one)
    frames = zip(one.pictures, one.labels, one.weight, strict=True)
    parts = [trainer.judge(weights, Batch(*(part[None] for part in frame))) for frame in frames]
    assert whole == pytest.approx(np.mean(parts), rel=1e-5)
    assert whole == trainer.judge(weights, one)  # no dropout, no augmentation
    wrong = Batch(one.pictures, (1 - one.labels).astype(np.int8), one.weight)
    assert trainer.judge(weights, wrong) > whole
    assert same(trainer.network.weights(), before)
    one.labels[:] = -1
    assert trainer.judge(weights, one) is None


def test_the_pictures_size_is_the_configurations():
    assert Trainer(configuration()).network.weights()["convolutions.0.weight"].shape[1] == 3
    with pytest.raises(RuntimeError):
        Trainer(configuration()).step(
            Batch(np.zeros((1, SIDE, 3 * SIDE, 3), np.uint8), batch().labels[:1], batch().weight[:1]), EVEN
        )
