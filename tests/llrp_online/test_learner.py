"""The learner in its small world. Runs that several tests look at are lived once."""

import itertools

import numpy as np
import pytest

from llrp_online import checkpoint
from llrp_online.checkpoint import CheckpointError
from llrp_online.digest import weights_sha256
from llrp_online.drift import DriftEvent
from llrp_online.events import Picture
from llrp_online.learner import Learner
from llrp_online.trainer import Trainer
from replay.buffer import BufferSettings, ReplayBuffer
from tests.llrp_online.worlds import bits, configuration, events, live, picture

S = 10**9
SHORT = events(14)


def digests(learner: Learner) -> tuple[str, str]:
    """Of the averaged weights and of those that are trained."""
    return weights_sha256(learner.trainer.weights()), weights_sha256(learner.trainer.network.weights())


@pytest.fixture(scope="module")
def grown() -> Learner:
    """A learner that has lived for a minute; for tests that do not change it."""
    return live(Learner(configuration()), events(60))


@pytest.fixture(scope="module")
def checkpoint_of_grown(grown, tmp_path_factory):
    path = tmp_path_factory.mktemp("grown") / "checkpoint"
    grown.save(path)
    return path


@pytest.fixture(scope="module")
def short() -> Learner:
    return live(Learner(configuration()), SHORT)


def test_it_learns_to_see(grown):
    score = grown.prequential.score()
    enough = (score.n_pos >= 10) & (score.n_neg >= 10)
    assert enough.sum() >= 4
    assert score.auc[enough].min() > 0.8
    late = grown.prequential.bands(newest=150)
    assert min(band.auc for band in late) > 0.8
    assert sum(band.log_loss for band in late) < 0.8 * sum(band.log_loss for band in grown.prequential.bands())


def test_there_is_nothing_to_see_for_the_blind():
    score = live(Learner(configuration()), events(40, blind=True)).prequential.score()
    enough = (score.n_pos >= 10) & (score.n_neg >= 10)
    assert enough.sum() >= 4
    assert score.auc[enough].mean() < 0.6


def test_the_status_adds_up(grown):
    status = grown.status()
    assert status.robot_s == pytest.approx(59.95)
    assert status.frames == 600
    assert 30 < status.waiting < 60
    assert status.remembered == len(grown.buffer)
    assert status.labelled == status.remembered + len(grown.held_out) == status.frames
    # Once warm, five steps a second.
    assert 5 * 55 < status.steps < 5 * 60
    assert status.steps == grown.trainer.steps
    assert len(status.known) == len(status.positives) == 3
    assert all(0 < positives < known for known, positives in zip(status.known, status.positives, strict=True))
    assert status.version == grown.publisher.newest.number == grown.predictor.version
    assert 0 <= status.version_age_s < 2.5
    assert (status.drops, status.paused, status.let_go) == ({}, False, 0)


def test_labels_in_memory_are_the_truth(grown):
    """The robot knows where it was at each time, so the labels at target 0 can be told without the rule."""
    truth, now = {}, None
    for event in events(60):
        if hasattr(event, "pose"):
            now = bits(event.pose[0])
        elif hasattr(event, "pixels"):
            truth[event.pixels.tobytes()] = now
    shards = list(grown.buffer.shards())
    for shown, labels in (frame for shard in shards for frame in zip(shard["pictures"], shard["labels"], strict=True)):
        np.testing.assert_array_equal(labels[0], truth[shown.tobytes()])


def test_same_events_and_seed_same_weights(short):
    again = live(Learner(configuration()), SHORT)
    assert digests(again) == digests(short)
    assert again.prequential.score().as_json() == short.prequential.score().as_json()
    other = live(Learner(configuration(training={"seed": 1})), SHORT)
    assert other.trainer.steps == short.trainer.steps > 40
    assert digests(other) != digests(short)


@pytest.mark.parametrize("cut_s", [0.5, 2.0, 5.53, 10.0])
def test_saved_and_loaded_it_goes_on_as_if_nothing_had_been(tmp_path, short, cut_s):
    cut = round(cut_s * len(SHORT) / 14)
    first = live(Learner(configuration()), SHORT[:cut])
    first.save(tmp_path / "c")
    # Another that has lived through something else becomes this one.
    second = live(Learner(configuration()), SHORT[60 : 60 + cut // 3])
    second.load(tmp_path / "c")
    assert digests(second) == digests(first)
    live(second, SHORT[cut:])
    assert second.trainer.steps == short.trainer.steps
    assert digests(second) == digests(short)
    assert second.status().robot_s == pytest.approx(short.status().robot_s)
    # And saving disturbs nobody.
    assert digests(live(first, SHORT[cut:])) == digests(short)


def test_pictures_that_wait_for_other_cameras_are_saved_too(tmp_path):
    cameras = [{"topic": name, "width": 16, "height": 16, "swap": "ba"[i]} for i, name in enumerate("ab")]
    stream = []
    for event in events(6):
        stream.append(event)
        if isinstance(event, Picture):
            stream.append(Picture(event.t_ns + 10_000_000, 1, event.pixels))
    whole = live(Learner(configuration(camera=cameras)), stream)
    cut = next(i for i, event in enumerate(stream) if i > 200 and isinstance(event, Picture)) + 1
    assert stream[cut - 1].camera == 0  # its partner comes after the cut
    first, second = Learner(configuration(camera=cameras)), Learner(configuration(camera=cameras))
    live(first, stream[:cut]).save(tmp_path / "c")
    second.load(tmp_path / "c")
    live(second, stream[cut:])
    assert first.status().frames + second.status().frames == whole.status().frames == 60
    assert digests(second) == digests(whole)


def test_a_version_is_always_newer_than_those_before(tmp_path, grown, checkpoint_of_grown):
    learner = live(Learner(configuration()), SHORT[:400])
    numbers = [learner.publish_now().number, learner.publish_now().number]
    learner.reset()
    assert learner.status().version is None
    learner.reset()
    numbers.append(learner.publish_now().number)
    learner.load(checkpoint_of_grown)
    numbers.append(learner.status().version)
    assert learner.status().version > grown.status().version
    numbers.append(learner.roll_back(numbers[-1]).number)
    assert numbers == sorted(set(numbers))


def test_after_a_load_it_predicts_as_before(grown, checkpoint_of_grown):
    learner = Learner(configuration())
    learner.load(checkpoint_of_grown)
    seen = picture(0.7, np.random.default_rng(5))
    np.testing.assert_array_equal(
        learner.predictor.predict(seen).probabilities, grown.predictor.predict(seen).probabilities
    )
    assert learner.status().version_age_s == pytest.approx(0.0)
    assert learner.status().waiting == grown.status().waiting


def test_a_warm_start_takes_weights_and_memory(grown, checkpoint_of_grown):
    learner = Learner(configuration())
    learner.warm_start(checkpoint_of_grown)
    published = weights_sha256(grown.publisher.newest.weights)
    assert weights_sha256(learner.trainer.weights()) == published
    assert weights_sha256(learner.publisher.newest.weights) == published
    assert len(learner.buffer) == len(grown.buffer)
    assert learner.status().waiting == learner.status().steps == learner.status().frames == 0
    # It sees from its first frame on, and new frames take no old frame's place.
    live(learner, events(6, seed=3, start_ns=500 * S))
    assert learner.trainer.steps >= 28
    assert len(learner.buffer) > len(grown.buffer)
    assert min(band.auc for band in learner.prequential.bands()) > 0.9


def test_a_warm_start_can_do_without_memory(checkpoint_of_grown):
    learner = Learner(configuration())
    learner.warm_start(checkpoint_of_grown, memory=False)
    assert len(learner.buffer) == 0
    live(learner, events(3, seed=3))
    assert len(learner.buffer) + len(learner.held_out) == learner.status().labelled > 0


def trained_offline(path, memory, frames):
    """A checkpoint such as `llrp train` writes: memory full to the brim, every frame used many times."""
    config = configuration()
    settings = BufferSettings(round(config.memory.budget_mb * 1e6), 8, 0.0, max_uses=10**9, duplicate_distance=0.0)
    buffer, trainer = ReplayBuffer((16, 16, 3), (3, 2), settings), Trainer(config)
    rng = np.random.default_rng(0)
    for number in range(frames or buffer.capacity):
        labels = rng.integers(0, 2, (3, 2), dtype=np.int8)
        buffer.add(number, picture(rng.uniform(0, 0.9), rng), labels, np.ones((3, 2), np.float32))
    for _ in range(memory):
        buffer.sample(4096)
    tensors = {"weights": trainer.weights(), "memory": buffer.state()}
    manifest = {"configuration": config.model_dump(mode="json"), "version": 1, "memory_random": buffer.random_state()}
    checkpoint.save(path, tensors, {**manifest, "next_id": buffer.capacity}, {"frames": buffer.shards()})
    return buffer


def test_memory_that_was_trained_on_offline_can_be_learned_from(tmp_path):
    trained_offline(tmp_path / "c", memory=20, frames=100)
    learner = Learner(configuration())
    learner.warm_start(tmp_path / "c")
    assert learner.buffer.settings.max_uses < 20 * 4096 / 100
    assert len({shown.tobytes() for shown in learner.buffer.sample(256).pictures}) > 50


def test_an_older_checkpoint_with_its_frames_in_one_piece_is_gone_on_from(tmp_path, short):
    short.save(tmp_path / "new")
    tensors, manifest = checkpoint.load(tmp_path / "new")
    (frames,) = checkpoint.load_parts(tmp_path / "new", "frames")
    old = {name: tensors["memory"][name] for name in ("ids", "uses", "recent", "offered")}
    checkpoint.save(tmp_path / "old", {**tensors, "memory": {**old, **frames}}, manifest)
    learner = Learner(configuration())
    learner.load(tmp_path / "old")
    assert learner.buffer.sizes == short.buffer.sizes
    np.testing.assert_array_equal(learner.buffer.class_counts, short.buffer.class_counts)
    np.testing.assert_array_equal(next(learner.buffer.shards())["pictures"], frames["pictures"])
    assert learner.buffer.sample(64) is not None


def test_memory_that_is_full_from_offline_has_room_for_new_frames(tmp_path):
    full = trained_offline(tmp_path / "c", memory=0, frames=None)
    assert len(full) == full.capacity
    learner = Learner(configuration())
    learner.warm_start(tmp_path / "c")
    live(learner, SHORT[:600])
    assert learner.buffer.sizes["recent"] == 40
    assert len(learner.buffer) <= learner.buffer.capacity


def test_what_was_trained_offline_is_no_run_to_go_on_from(tmp_path):
    trained_offline(tmp_path / "c", memory=0, frames=10)
    learner = live(Learner(configuration()), SHORT[:300])
    with pytest.raises(CheckpointError, match=r"not saved by an online learner.*warm start"):
        learner.load(tmp_path / "c")
    assert learner.status().frames == 60  # it is left as it was


OTHERS = {
    "more targets": ({"targets": {"stop_m": 0.6}}, "targets"),
    "other targets": ({"targets": {"start_m": 0.2, "stop_m": 0.6}}, "targets"),
    "another sensor": ({"short_range": [{"name": "ahead", "field": "range", "below": 1.0}]}, "ahead"),
    "another network": ({"network": {"preset": "paper"}}, "network"),
    "other pictures": ({"camera": [{"topic": "camera", "width": 32, "height": 16}]}, "network"),
}


@pytest.mark.parametrize(("tables", "said"), OTHERS.values(), ids=OTHERS.keys())
@pytest.mark.parametrize("command", ["load", "warm_start"])
def test_another_robots_checkpoint_is_refused(checkpoint_of_grown, command, tables, said):
    learner = Learner(configuration(**tables))
    before = digests(learner)
    with pytest.raises(CheckpointError, match=said) as caught:
        getattr(learner, command)(checkpoint_of_grown)
    assert str(checkpoint_of_grown) in str(caught.value)
    assert "give the configuration it was trained with" in str(caught.value)
    assert digests(learner) == before
    assert learner.status().version is None


def test_reset_is_a_new_life(short):
    learner = live(Learner(configuration()), events(5, seed=8))
    learner.reset()
    status = learner.status()
    assert (status.frames, status.steps, status.remembered, status.waiting, status.version) == (0, 0, 0, 0, None)
    assert digests(live(learner, SHORT)) == digests(short)


def test_roll_back_goes_on_from_an_old_version():
    learner = live(Learner(configuration()), SHORT)
    kept = learner.publisher.kept
    assert len(kept) >= 3
    old = weights_sha256(learner.publisher.find(kept[0]).weights)
    assert old != weights_sha256(learner.trainer.weights())
    version = learner.roll_back(kept[0])
    assert version.number == kept[-1] + 1
    assert weights_sha256(version.weights) == old == weights_sha256(learner.trainer.weights())
    assert learner.predictor.version == version.number
    live(learner, events(4, seed=2, start_ns=15 * S))
    assert weights_sha256(learner.trainer.weights()) != old
    assert weights_sha256(version.weights) == old
    with pytest.raises(KeyError, match="version 999 is not kept"):
        learner.roll_back(999)


def test_what_goes_out_is_calibrated_and_a_checkpoint_keeps_it(tmp_path):
    learner = live(Learner(configuration()), SHORT)
    version = learner.publish_now()
    assert not np.array_equal(version.calibration.scale, np.ones(len(version.calibration.scale)))
    assert weights_sha256(version.outgoing) != weights_sha256(version.weights)
    learner.save(tmp_path / "kept")
    for begin in (Learner.load, Learner.warm_start):
        again = Learner(configuration())
        begin(again, tmp_path / "kept")
        assert weights_sha256(again.publisher.newest.outgoing) == weights_sha256(version.outgoing)
        assert weights_sha256(again.publisher.newest.weights) == weights_sha256(version.weights)


def test_an_alarm_keeps_what_was_known_before():
    learner = live(Learner(configuration()), SHORT)
    before = learner.publisher.newest.number
    learner._drift.update = lambda t_ns, losses: [DriftEvent(t_ns, 0, 0.1, 0.9)] if learner.alarms == 0 else []
    live(learner, events(30, seed=3, start_ns=15 * S))
    assert learner.alarms == 1
    marked = learner.publisher.kept[0]
    assert before <= marked < learner.publisher.newest.number - learner.configuration.publishing.keep
    assert learner.roll_back(marked).number == learner.publisher.newest.number


def test_held_out_frames_are_not_trained_on_while_they_judge(monkeypatch):
    learner = Learner(configuration())
    step, seen, ever_held = learner.trainer.step, set(), set()

    def watched(batch, counts):
        held = learner.held_out.batch()
        judges = set() if held is None else {shown.tobytes() for shown in held.pictures}
        drawn = {shown.tobytes() for shown in batch.pictures}
        assert not judges & drawn
        assert not any(
            number in learner.buffer for number in range(learner.labeller.next_id) if number in learner.held_out
        )
        seen.update(drawn)
        ever_held.update(judges)
        return step(batch, counts)

    monkeypatch.setattr(learner.trainer, "step", watched)
    live(learner, events(25))
    assert len(learner.held_out) == 16
    assert len(ever_held) >= 40
    # And later they are: none is lost.
    assert ever_held & seen


def test_held_out_labels_improve_too():
    """In the first block held out the robot drives on: what lies ahead becomes known while the frames are held."""
    learner = Learner(configuration(publishing={"held_out_share": 0.5, "held_out_frames": 64}))
    first, held = {}, range(11, 15)
    for event in events(4):
        learner.take(event)
        for number in held:
            if number in learner.held_out:
                first.setdefault(number, learner.held_out.get(number).labels)
    assert list(first) == list(held)
    for number, labels in first.items():
        later = learner.held_out.get(number).labels
        assert (labels >= 0).sum() < (later >= 0).sum() == later.size
        assert number not in learner.buffer


def test_paused_it_takes_no_steps_but_goes_on_remembering():
    learner = live(Learner(configuration()), SHORT[:250])
    for event in SHORT[250:300]:
        learner.take(event)
    assert learner.due()
    steps, frames, remembered = learner.trainer.steps, learner.status().frames, len(learner.buffer)
    assert steps > 0
    learner.paused = True
    assert not learner.due()
    live(learner, SHORT[300:600])
    status = learner.status()
    assert status.paused
    assert (status.steps, status.frames) == (steps, frames + 60)
    assert len(learner.buffer) + len(learner.held_out) > remembered
    learner.paused = False
    live(learner, SHORT[600:])
    # It goes on at its own pace: what was not due meanwhile is not made up for.
    assert steps < learner.trainer.steps <= steps + 5 * 3 + 1


def test_recordings_may_come_in_any_order_of_their_clocks():
    """The clocks of recordings start where they please; versions must go on coming."""
    learner, versions = Learner(configuration()), []
    for seed, start_s in enumerate((1000, 10, 500, 490)):
        live(learner, events(8, seed=seed, start_ns=start_s * S))
        learner.end_recording()
        assert learner.status().waiting == 0
        versions.append(learner.status().version)
        assert 0 <= learner.status().version_age_s <= 2.5
    assert np.diff(versions).tolist() == pytest.approx([4, 4, 4], abs=1)
    assert learner.status().robot_s == pytest.approx(4 * 7.95)


def test_a_frame_is_not_trained_on_for_ever():
    learner = live(Learner(configuration(memory={"max_uses": 1}, training={"steps_per_second": 20.0})), SHORT)
    # Each step uses up at least one frame; where none is left a step is let pass, and nothing waits for it.
    assert 40 < learner.trainer.steps <= learner.status().labelled
    assert learner.pace.let_go == 0
    assert not learner.due()


def test_frames_that_waited_in_another_version_are_refused(tmp_path, short):
    short.save(tmp_path / "c")
    tensors, manifest = checkpoint.load(tmp_path / "c")
    tensors["pending"] = {name.replace("frames.", "frame."): array for name, array in tensors["pending"].items()}
    parts = {"frames": checkpoint.load_parts(tmp_path / "c", "frames")}
    checkpoint.save(tmp_path / "other", tensors, manifest, parts)
    learner = Learner(configuration())
    with pytest.raises(CheckpointError, match="another version of this program; use it for a warm start"):
        learner.load(tmp_path / "other")
    learner.warm_start(tmp_path / "other")
    assert len(learner.buffer) == len(short.buffer)


def test_it_tells_what_its_minutes_were_like(grown):
    entries = grown.minutes()
    assert entries
    assert all(later.start_s == entry.end_s for entry, later in itertools.pairwise(entries))
    told = [entry.as_json() for entry in entries]
    for _ in range(len(entries)):  # a few at each asking
        told = [entry.as_json() for entry in grown.minutes()]
    status = grown.status()
    assert sum(minute["steps"] for minute in told) <= status.steps
    assert sum(minute["frames"] for minute in told) <= status.frames
    assert all(minute["loss"] > 0 for minute in told if minute["steps"])
    bands = [band for minute in told for band in minute["bands"] if band["auc"] is not None]
    assert bands
    assert all(0 <= band["low"] <= band["high"] <= 1 for band in bands)


def test_it_tells_the_labels_of_a_frame_before_and_after_its_window_closed():
    learner, told, ids = Learner(configuration()), {}, {}
    for event in events(40.0):
        updates = learner.take(event)
        while learner.due():
            learner.step()
        told |= {int(update.t_ns): update.labels for update in updates}
        for t_ns in updates.t_ns[~updates.closed].tolist():
            ids[t_ns], labels = learner.labels_of(t_ns, -1)
            np.testing.assert_array_equal(labels, told[t_ns])
    assert learner.labels_of(1, -1) is None
    closed = [t_ns for t_ns in told if learner.labeller.store.labels_at(t_ns) is None and t_ns in ids]
    found = {t_ns: learner.labels_of(t_ns, ids[t_ns]) for t_ns in closed}
    kept = {t_ns: answer for t_ns, answer in found.items() if answer is not None}  # predicted when they came
    assert len(kept) > 20
    for t_ns, (frame_id, labels) in kept.items():
        assert frame_id == ids[t_ns]
        np.testing.assert_array_equal(labels, told[t_ns])
