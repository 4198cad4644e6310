"""Where a run is kept."""

import numpy as np
import pytest

from agents.run_folder import RunFolder
from llrp_online import checkpoint
from llrp_online.checkpoint import CheckpointError
from llrp_online.learner import Learner
from tests.llrp_online.worlds import configuration


def test_the_minutes_asked_for_are_kept_with_their_weights(tmp_path):
    learner, folder = Learner(configuration()), RunFolder(tmp_path / "deep" / "run", [10, 2])
    for minute in (1, 2, 3, 10):
        folder.keep_minute(minute, learner)
    kept = dict(folder.minutes())
    assert list(kept) == [2, 10]
    for name, array in learner.trainer.weights().items():
        np.testing.assert_array_equal(kept[10][name], array)
    manifest = checkpoint.load(folder.path / "minutes" / "002")[1]
    assert (manifest["minute"], manifest["configuration"]["robot"]["name"]) == (2, learner.configuration.robot.name)


def test_a_minute_kept_twice_is_the_newer_one(tmp_path):
    learner, folder = Learner(configuration()), RunFolder(tmp_path, [1])
    folder.keep_minute(1, learner)
    zero = {name: np.zeros_like(array) for name, array in learner.trainer.weights().items()}
    learner.trainer.become(zero)
    folder.keep_minute(1, learner)
    [(minute, weights)] = folder.minutes()
    assert minute == 1
    assert not any(array.any() for array in weights.values())


def test_a_run_without_minutes_has_none_and_strangers_are_passed_over(tmp_path):
    folder = RunFolder(tmp_path, [1])
    assert list(folder.minutes()) == []
    (tmp_path / "minutes" / "notes").mkdir(parents=True)
    assert list(folder.minutes()) == []


def test_a_folder_whose_checkpoint_could_not_be_written_is_refused_beforehand(tmp_path):
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "thesis.txt").write_text("not to be replaced")
    with pytest.raises(CheckpointError, match="exists and is no checkpoint"):
        RunFolder(tmp_path, [])
