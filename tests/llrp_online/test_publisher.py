import numpy as np
import pytest

from llrp_online.calibration import Calibration
from llrp_online.configuration.learning import Publishing
from llrp_online.publisher import Publisher
from replay.batch import Batch

S = 10**9
HELD_OUT = Batch(np.zeros((1, 2, 2, 3), np.uint8), np.zeros((1, 1, 1), np.int8), np.ones((1, 1, 1), np.float32))
SETTINGS = Publishing(every_s=2.0, margin=0.05, trust_after_s=60.0, keep=3)


def weights(loss):
    """Weights that the judge finds this bad."""
    return {"loss": np.array([loss], np.float32)}


def publisher(settings=SETTINGS):
    return Publisher(settings, lambda found, _: float(found["loss"][0]))


def test_the_first_version_goes_out_whatever_it_is():
    gate = publisher()
    assert gate.newest is None
    version = gate.offer(weights(9.0), HELD_OUT, 5 * S)
    assert (version.number, version.t_ns, version.held_out_loss) == (1, 5 * S, 9.0)
    assert gate.newest is version


def test_worse_weights_are_refused_after_a_while_and_never_before():
    gate, start = publisher(), 1000 * S
    gate.offer(weights(0.1), HELD_OUT, start)
    for passed_s in (2.0, 30.0, 59.9):
        assert gate.offer(weights(9.0), HELD_OUT, start + round(passed_s * S)) is not None
    assert gate.rejected == 0
    gate.offer(weights(1.0), HELD_OUT, start + round(59.95 * S))
    assert gate.offer(weights(9.0), HELD_OUT, start + 60 * S) is None
    assert gate.offer(weights(1.06), HELD_OUT, start + 62 * S) is None
    assert (gate.rejected, gate.newest.held_out_loss) == (2, 1.0)
    # Not worse than the margin allows, or better.
    assert gate.offer(weights(1.04), HELD_OUT, start + 64 * S) is not None
    assert gate.offer(weights(0.5), HELD_OUT, start + 66 * S) is not None
    assert gate.rejected == 2


def test_the_newest_is_judged_anew_on_the_frames_of_now():
    judged = []
    losses = {"old": {1: 0.1, 2: 2.0}, "new": {1: 0.2, 2: 1.0}}

    def judge(found, held_out):
        judged.append(held_out)
        return losses[next(iter(found))][len(held_out.pictures)]

    gate = Publisher(Publishing(trust_after_s=0.0), judge)
    two = Batch(*(np.repeat(part, 2, 0) for part in (HELD_OUT.pictures, HELD_OUT.labels, HELD_OUT.weight)))
    gate.offer({"old": np.zeros(1, np.float32)}, HELD_OUT, 0)
    assert gate.offer({"new": np.zeros(1, np.float32)}, HELD_OUT, S) is None
    # The world has changed, and there the old ones are worse.
    assert gate.offer({"new": np.zeros(1, np.float32)}, two, 2 * S).held_out_loss == 1.0
    assert judged[-1] is two


def test_where_nothing_can_judge_weights_go_out():
    gate = publisher(Publishing(trust_after_s=0.0))
    gate.offer(weights(0.1), HELD_OUT, 0)
    assert gate.offer(weights(9.0), None, S).held_out_loss is None
    blind = Publisher(Publishing(trust_after_s=0.0), lambda *_: None)
    assert blind.offer(weights(1.0), HELD_OUT, 0) is not None
    assert blind.offer(weights(9.0), HELD_OUT, S).held_out_loss is None


def test_weights_that_are_no_numbers_are_worse_than_any():
    gate = publisher(Publishing(trust_after_s=0.0))
    gate.offer(weights(1.0), HELD_OUT, 0)
    assert gate.offer(weights(float("nan")), HELD_OUT, S) is None
    assert gate.rejected == 1
    # And any are better than those.
    gate.publish(weights(float("nan")), 2 * S)
    assert gate.offer(weights(5.0), HELD_OUT, 3 * S) is not None


def test_it_is_due_at_once_and_then_every_so_often():
    gate = publisher()
    assert gate.due(0)
    gate.offer(weights(1.0), HELD_OUT, 0)
    assert [gate.due(round(t_s * S)) for t_s in (0.5, 1.99, 2.0, 3.0)] == [False, False, True, True]
    gate = publisher(Publishing(every_s=2.0, trust_after_s=0.0))
    gate.offer(weights(1.0), HELD_OUT, 0)
    gate.offer(weights(9.0), HELD_OUT, 2 * S)  # refused, and still a try
    assert not gate.due(3 * S)


def test_so_many_are_kept_and_found_again():
    gate = publisher()
    for number in range(1, 6):
        gate.publish(weights(number), number * S)
        assert gate.newest.number == number
    assert gate.kept == [3, 4, 5]
    assert gate.find(4).weights["loss"].tolist() == [4.0]
    for number in (2, 6):
        with pytest.raises(KeyError, match=rf"version {number} is not kept; kept: \[3, 4, 5\]"):
            gate.find(number)


def test_numbers_only_grow():
    gate = publisher()
    gate.publish(weights(1), 0)
    gate.go_on_from(7)
    assert gate.publish(weights(1), 0).number == 8
    gate.go_on_from(3)
    assert gate.publish(weights(1), 0).number == 9
    assert gate.offer(weights(1), HELD_OUT, S).number == 10


def test_a_marked_version_stays_within_reach():
    gate = publisher()
    gate.offer(weights(1.0), HELD_OUT, 0)
    gate.mark()
    gate.mark()
    for t_s in range(2, 20, 2):
        gate.offer(weights(1.0), HELD_OUT, t_s * S)
    assert gate.kept == [1, 8, 9, 10]
    assert gate.find(1).number == 1


def test_marking_before_the_first_version_is_nothing():
    gate = publisher()
    gate.mark()
    assert gate.kept == []


def test_a_version_goes_out_calibrated():
    found = {"outputs.weight": np.ones((2, 3), np.float32), "outputs.bias": np.ones(2, np.float32)}
    raw, calibrated = publisher(), publisher()
    assert raw.publish(found, 0).outgoing is found
    version = calibrated.publish(found, 0, calibration=Calibration(np.array([0.5]), np.array([1.0])))
    assert version.weights is found
    np.testing.assert_allclose(version.outgoing["outputs.weight"], 0.5)
    np.testing.assert_allclose(version.outgoing["outputs.bias"], 1.5)
