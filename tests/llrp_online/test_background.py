"""The thread around the learner. Where a test needs the thread to be busy, it is held in a step until it is let go."""

import os
import threading
import time

import pytest

from llrp_online import background
from llrp_online.background import BackgroundLearner, Listeners
from llrp_online.learner import Learner
from tests.llrp_online.worlds import configuration, events

WAIT_S = 20.0  # far more than anything takes; only a failing test waits so long


class Gate:
    """A place where the thread can be held."""

    def __init__(self):
        self.reached, self.opened = threading.Event(), threading.Event()

    def __call__(self, *_):
        self.reached.set()
        assert self.opened.wait(WAIT_S)


def one(event):
    """Messages are events already."""
    return [event]


def until(condition):
    """Wait for what another thread is about to do; the thread has no event for it."""
    end_s = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end_s, "it never came"
        time.sleep(0.001)


@pytest.fixture
def learner():
    return Learner(configuration())


def test_it_learns_from_what_is_submitted(learner):
    told, labels = [], []
    listeners = Listeners(weights=lambda version: told.append(version.number), labels=labels.extend)
    with BackgroundLearner(learner, one, listeners) as thread:
        for event in events(10):
            thread.submit(event)
        until(lambda: thread.backlog == 0)
        status = thread.call(lambda own: own.status())
        assert status.frames == 100
        until(lambda: thread.call(lambda own: not own.due()))
        assert thread.call(lambda own: own.trainer.steps) > 5
        newest = thread.call(lambda own: own.publisher.newest.number)
        until(lambda: newest in told)
    assert told == sorted(set(told))
    assert any(update.closed for update in labels)
    assert thread.failure is None
    assert not thread.drops


def test_submit_never_waits_however_busy_the_thread(learner):
    gate = Gate()
    with BackgroundLearner(learner, lambda message: gate(message) or []) as thread:
        thread.submit("first")
        assert gate.reached.wait(WAIT_S)
        start_s = time.monotonic()
        for number in range(1000):
            thread.submit(number)
        took_s = time.monotonic() - start_s
        assert thread.backlog == 1000
        gate.opened.set()
        until(lambda: thread.backlog == 0)
    # It takes about a millisecond; had it waited for the thread, this test would have failed in the gate.
    assert took_s < 1.0


def test_submit_never_waits_for_a_slow_step(learner, monkeypatch):
    gate = Gate()
    monkeypatch.setattr(learner, "due", lambda: True)
    monkeypatch.setattr(learner, "step", gate)
    with BackgroundLearner(learner, lambda _: []) as thread:
        assert gate.reached.wait(WAIT_S)
        for number in range(1000):
            thread.submit(number)
        assert thread.backlog == 1000
        gate.opened.set()
        until(lambda: thread.backlog == 0)


def test_a_full_queue_drops_the_oldest_and_counts(learner, monkeypatch):
    monkeypatch.setattr(background, "QUEUE", 10)
    gate, taken, statuses = Gate(), [], []
    monkeypatch.setattr(background, "_STATUS_EVERY_S", 0.0)

    def ingest(message):
        gate()
        taken.append(message)
        return []

    with BackgroundLearner(learner, ingest, Listeners(status=statuses.append)) as thread:
        thread.submit("held")
        assert gate.reached.wait(WAIT_S)
        for number in range(25):
            thread.submit(number)
        assert thread.backlog == 10
        gate.opened.set()
        until(lambda: len(taken) == 11)
        count = len(statuses)
        until(lambda: len(statuses) > count + 1)
    assert taken == ["held", *range(15, 25)]
    assert list(thread.drops.values()) == [15]
    assert statuses[-1].drops == dict(thread.drops)


def test_a_call_runs_in_the_thread_and_its_answer_comes_back(learner):
    with BackgroundLearner(learner, one) as thread:
        assert thread.call(lambda own: (own is learner, threading.current_thread().name)) == (True, "learner")
        with pytest.raises(KeyError, match="version 3 is not kept"):
            thread.call(lambda own: own.roll_back(3))
        assert thread.call(lambda _: 7) == 7  # an error in a command ends nothing
        assert thread.failure is None


def test_a_call_waits_no_longer_than_it_is_told(learner):
    gate = Gate()
    with BackgroundLearner(learner, lambda message: gate(message) or []) as thread:
        thread.submit("hold")
        assert gate.reached.wait(WAIT_S)
        with pytest.raises(TimeoutError):
            thread.call(lambda _: None, timeout_s=0.01)
        gate.opened.set()


def test_commands_reach_the_listeners_too(learner):
    told, first = [], threading.Event()

    def tell(version):
        told.append(version.number)
        first.set()

    with BackgroundLearner(learner, one, Listeners(weights=tell)) as thread:
        assert thread.call(lambda own: own.publish_now().number) == 1
        assert first.wait(WAIT_S)
        thread.call(lambda own: own.roll_back(1))
        until(lambda: told == [1, 2])


def test_it_stops_within_a_second_while_it_trains_flat_out(learner):
    for event in events(6):
        learner.take(event)
    learner.due = lambda: True
    thread = BackgroundLearner(learner, one).__enter__()
    until(lambda: learner.trainer.steps > 3)
    start_s = time.monotonic()
    thread.stop()
    assert time.monotonic() - start_s < 1.0
    assert not thread._thread.is_alive()
    steps = learner.trainer.steps
    thread.stop()  # a second time does no harm
    assert learner.trainer.steps == steps
    assert thread.failure is None


def test_it_stops_at_once_while_it_idles_and_while_it_rests():
    idle = Learner(configuration())
    resting = Learner(configuration(training={"core_share": 1e-6}))
    for event in events(6):
        resting.take(event)
    assert resting.due()
    for learner in (idle, resting):
        thread = BackgroundLearner(learner, one).__enter__()
        until(lambda: learner is idle or learner.trainer.steps > 0)  # noqa: B023
        for _ in range(20):  # each goes once round the thread's loop
            thread.call(lambda _: None)
        start_s = time.monotonic()
        thread.stop()
        assert time.monotonic() - start_s < 1.0
    assert resting.trainer.steps == 1  # a millionth of a core is soon used up


def test_a_call_after_the_end_is_refused_at_once(learner):
    with BackgroundLearner(learner, one) as thread:
        pass
    with pytest.raises(RuntimeError, match="the learner has stopped"):
        thread.call(lambda _: None)
    with pytest.raises(RuntimeError, match="the learner has stopped"):
        BackgroundLearner(learner, one).call(lambda _: None)  # nor before the start


def held_call(thread, gate):
    """A call that waits while the thread is held; the error it ends with will be in the list."""
    found = []

    def call():
        try:
            thread.call(lambda _: None)
        except RuntimeError as error:
            found.append(str(error))

    caller = threading.Thread(target=call)
    assert gate.reached.wait(WAIT_S)
    caller.start()
    until(lambda: thread._calls.qsize() == 1)
    return caller, found


def test_whoever_waits_for_an_answer_is_told_of_the_end(learner, caplog):
    for fails in (False, True):
        gate = Gate()

        def ingest(message, gate=gate, fails=fails):
            gate(message)
            if fails:
                raise ValueError("ingest broke")
            return []

        with BackgroundLearner(learner, ingest) as thread:
            thread.submit("hold")
            caller, found = held_call(thread, gate)
            if not fails:
                thread._stopping.set()
            start_s = time.monotonic()
            gate.opened.set()
            caller.join(WAIT_S)
            assert time.monotonic() - start_s < 5.0  # its own timeout is thirty seconds
        assert found == ["the learner has stopped"]


def test_a_failure_is_kept_logged_and_given_as_the_cause(learner, caplog):
    def ingest(_):
        raise ValueError("no such message")

    with BackgroundLearner(learner, ingest) as thread:
        thread.submit("bad")
        until(lambda: not thread._thread.is_alive())
        assert isinstance(thread.failure, ValueError)
        assert "the learner's thread has failed" in caplog.text
        assert "no such message" in caplog.text
        with pytest.raises(RuntimeError, match="the learner has stopped") as caught:
            thread.call(lambda _: None)
        assert caught.value.__cause__ is thread.failure
        thread.submit("another")  # sensors are not troubled


def test_the_status_is_told_every_so_often(learner, monkeypatch):
    monkeypatch.setattr(background, "_STATUS_EVERY_S", 0.01)
    statuses, names = [], set()

    def tell(status):
        statuses.append(status)
        names.add(threading.current_thread().name)

    with BackgroundLearner(learner, one, Listeners(status=tell)) as thread:
        for event in events(2):
            thread.submit(event)
        until(lambda: statuses and statuses[-1].frames == 20)
        count = len(statuses)
        until(lambda: len(statuses) > count + 2)  # with nothing to do too
    assert names == {"learner"}


def test_paused_the_thread_goes_on_taking_in(learner):
    with BackgroundLearner(learner, one) as thread:
        thread.call(lambda own: setattr(own, "paused", True))
        for event in events(8):
            thread.submit(event)
        until(lambda: thread.backlog == 0)
        status = thread.call(lambda own: own.status())
        assert (status.frames, status.steps, status.paused) == (80, 0, True)


def test_training_has_the_lowest_priority_and_nobody_else(learner):
    mine = os.getpriority(os.PRIO_PROCESS, 0)
    with BackgroundLearner(learner, one) as thread:
        theirs = thread.call(lambda _: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
    assert theirs == 19
    assert os.getpriority(os.PRIO_PROCESS, 0) == mine
