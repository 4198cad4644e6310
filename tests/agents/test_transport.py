import multiprocessing
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import psutil
import pytest

from agents.transport import (
    Frames,
    NoAnswer,
    Received,
    Refused,
    Session,
    State,
    Stream,
    TransportError,
    announce,
    call,
    free_endpoint,
    key,
    open_session,
    present,
    serve,
    subscribe_all,
    subscribe_latest,
    subscribe_state,
    subscribe_stream,
    watch,
)
from tests.agents import processes

pytestmark = pytest.mark.live

#: What goes over a bus takes no longer.
until = partial(processes.until, timeout_s=5.0)

ODOMETRY = "nav_msgs/msg/Odometry"
spawn = multiprocessing.get_context("spawn")


@contextmanager
def pair() -> Iterator[tuple[Session, Session]]:
    endpoint = free_endpoint()
    with open_session(endpoint) as first, open_session(endpoint) as second:
        until(lambda: bool(first.zenoh.info.peers_zid()), "the other session")
        yield first, second


def receive(subscriber, session, key, count, send) -> list[Received]:
    """What comes of `send()` until `count` messages are there."""
    found: list[Received] = []
    with subscriber(session, key, found.append):
        time.sleep(0.1)  # for the subscription to get around
        send()
        until(lambda: len(found) >= count, "the messages")
    return found


def test_three_agents_meet_whoever_comes_first():
    endpoint = free_endpoint()
    with open_session(endpoint) as first, open_session(endpoint) as second, open_session(endpoint) as third:
        for session in (first, second, third):
            until(lambda session=session: len(session.zenoh.info.peers_zid()) == 2, "both other sessions")


def test_others_go_on_when_the_hub_goes_and_a_new_one_is_found():
    endpoint = free_endpoint()
    hub = open_session(endpoint)
    with open_session(endpoint) as second, open_session(endpoint) as third:
        until(lambda: len(second.zenoh.info.peers_zid()) == 2, "both other sessions")
        hub.close()
        found: list[Received] = []
        with subscribe_latest(third, "bot/a", found.append), Frames(second, "bot/a", ODOMETRY) as publisher:
            until(lambda: publisher.put(b"x") or bool(found), "a message")
        with open_session(endpoint, hub=True) as new:
            until(lambda: len(new.zenoh.info.peers_zid()) == 2, "both other sessions")


def test_an_endpoint_that_cannot_be_is_an_error():
    with pytest.raises(TransportError, match=r"nonsense: cannot meet there; expected such as tcp/127.0.0.1:7447"):
        open_session("nonsense")
    endpoint = free_endpoint()
    with open_session(endpoint, hub=True), pytest.raises(TransportError, match="Address already in use"):
        open_session(endpoint, hub=True)


def test_only_loopback_is_listened_on():
    with open_session(free_endpoint()) as session:
        mine = [c.laddr.ip for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN]
        assert session.zenoh.info.peers_zid() == []
        assert set(mine) == {"127.0.0.1"}


@pytest.mark.parametrize("name", ["a b", "a//b", "a/*", "a/", "", "$*", "a?b", "@a"])
def test_a_topic_that_zenoh_would_read_otherwise_is_an_error(name):
    with pytest.raises(TransportError, match="expected names joined by single slashes"):
        key("bot", name)


def test_a_message_carries_type_count_and_clocks():
    with pair() as (first, second), Stream(first, "bot/odom", ODOMETRY) as stream:
        before = time.monotonic_ns(), time.time_ns()
        found = receive(subscribe_stream, second, "bot/odom", 2, lambda: [stream.put(b"1"), stream.put(b"2")])
    assert [(m.key, m.type, m.data) for m in found] == [("bot/odom", ODOMETRY, b"1"), ("bot/odom", ODOMETRY, b"2")]
    assert [m.sent.sequence for m in found if m.sent] == [0, 1]
    assert found[0].sent is not None
    assert found[0].sent.monotonic_ns >= before[0]
    assert abs(found[0].sent.wall_ns - before[1]) < 5e9
    assert 0 < found[0].age_s() < 60


def test_a_message_of_a_stranger_has_no_count():
    with pair() as (first, second):
        found = receive(
            subscribe_latest, second, "bot/x", 1, lambda: first.zenoh.put("bot/x", b"1", attachment=b"other")
        )
    assert found == [Received("bot/x", "", b"1", None)]
    assert found[0].age_s() == 0.0


def test_a_slow_reader_of_frames_gets_the_newest():
    with pair() as (first, second), Frames(first, "bot/camera", "sensor_msgs/msg/Image") as frames:
        ages: list[float] = []
        seen: list[int] = []

        def slow(message: Received) -> None:
            ages.append(message.age_s())
            seen.append(int(message.data[:4].hex(), 16))
            time.sleep(0.03)

        with subscribe_latest(second, "bot/camera", slow) as subscription:
            time.sleep(0.1)
            for i in range(150):
                frames.put(i.to_bytes(4, "big") + bytes(15_000))
                time.sleep(0.003)
            until(lambda: seen[-1] == 149, "the newest")
        assert len(seen) < 60
        assert subscription.missed == 150 - len(seen) - seen[0]
        assert sorted(ages)[len(ages) // 2] < 0.1


def test_bursts_of_frames_get_through():
    with pair() as (first, second), Frames(first, "bot/camera", "sensor_msgs/msg/Image") as frames:
        found: list[int] = []
        with subscribe_stream(second, "bot/camera", lambda message: found.append(message.data[0])):
            time.sleep(0.1)
            for burst in range(1, 101):
                for i in range(8):
                    frames.put(bytes([i]) * 15_000)
                until(lambda burst=burst: len(found) == 8 * burst, f"burst {burst}")
        assert found == list(range(8)) * 100


def test_a_patient_reader_loses_nothing_in_a_short_stall_and_skips_to_the_newest_after_a_long_one():
    with pair() as (first, second), Frames(first, "bot/camera", "sensor_msgs/msg/Image") as frames:
        seen: list[int] = []
        stall, stalled = threading.Event(), threading.Event()

        def handler(message: Received) -> None:
            seen.append(message.data[0])
            if message.data[0] in (0, 10):
                stalled.set()
                stall.wait(5)

        with subscribe_latest(second, "bot/camera", handler, patience_s=1e3) as subscription:
            time.sleep(0.1)
            for i in range(7):
                frames.put(bytes([i]))
                assert stalled.wait(5)
                time.sleep(0.01)
            stall.set()
            until(lambda: seen == list(range(7)), "all, in order")
            assert subscription.missed == 0
        seen.clear()
        stall.clear()
        stalled.clear()
        with subscribe_latest(second, "bot/camera", handler, patience_s=1e-9):
            time.sleep(0.1)
            for i in range(10, 17):
                frames.put(bytes([i]))
                assert stalled.wait(5)
                time.sleep(0.01)
            stall.set()
            until(lambda: seen == [10, 16], "the newest, once there is time")


def test_a_patient_reader_that_is_too_slow_still_gets_what_is_new():
    with pair() as (first, second), Frames(first, "bot/camera", "sensor_msgs/msg/Image") as frames:
        ages: list[float] = []
        seen: list[int] = []

        def slow(message: Received) -> None:
            ages.append(message.age_s())
            seen.append(message.data[0])
            time.sleep(0.05)

        with subscribe_latest(second, "bot/camera", slow, patience_s=1e3) as subscription:
            time.sleep(0.1)
            for i in range(200):
                frames.put(bytes([i]))
                time.sleep(0.01)
            until(lambda: seen[-1] == 199, "the newest")
        assert seen == sorted(seen)
        assert len(seen) < 80
        assert subscription.missed == 200 - len(seen) - seen[0]
        assert sorted(ages)[len(ages) // 2] < 0.5  # a queue of sixteen would be eight tenths of a second behind


def test_a_stream_is_whole_and_in_order_across_a_stall():
    count = 5000
    with pair() as (first, second), Stream(first, "bot/odom", ODOMETRY, cache=count) as stream:
        found: list[int] = []
        stall = threading.Event()

        def handler(message: Received) -> None:
            stall.wait(5)
            found.append(int.from_bytes(message.data, "big"))

        with subscribe_stream(second, "bot/odom", handler) as subscription:
            time.sleep(0.1)
            for i in range(count):
                stream.put(i.to_bytes(4, "big"))
            stall.set()
            until(lambda: len(found) == count, "all of them")
            assert found == list(range(count))
            assert subscription.missed == 0


def test_who_joins_a_stream_late_gets_what_its_cache_holds():
    with pair() as (first, second), Stream(first, "bot/odom", ODOMETRY, cache=10) as stream:
        for i in range(25):
            stream.put(bytes([i]))
        time.sleep(0.1)  # what is still on its way when they join would come besides
        found: list[Received] = []
        with subscribe_stream(second, "bot/odom", found.append):
            until(lambda: len(found) == 10, "what was sent before")
            stream.put(b"\xff")
            until(lambda: len(found) == 11, "what came after")
    assert [m.data[0] for m in found] == [*range(15, 25), 255]


def test_who_joins_late_gets_the_last_state():
    with pair() as (first, second), State(first, "bot/learner/weights", "") as state:
        state.put(b"old")
        state.put(b"new")
        found = receive(subscribe_state, second, "bot/learner/weights", 1, lambda: None)
    assert [(m.type, m.data) for m in found] == [("", b"new")]


def test_all_of_a_robot_and_nothing_of_another():
    with pair() as (first, second):
        found: list[Received] = []
        with (
            Frames(first, key("bot", "camera/image"), "sensor_msgs/msg/Image") as frames,
            Stream(first, key("bot", "odom"), ODOMETRY) as stream,
            Stream(first, key("bot2", "odom"), ODOMETRY) as other,
            subscribe_all(second, "bot", found.append) as subscription,
        ):
            time.sleep(0.1)
            for i in range(50):
                for publisher in (frames, stream, other):
                    publisher.put(bytes([i]))
                time.sleep(0.002)  # frames that come too fast are dropped
            until(lambda: sum(m.key == "bot/odom" for m in found) == 50, "the odometry")
        seen = {name: [m.data[0] for m in found if m.key == f"bot/{name}"] for name in ("odom", "camera/image")}
        assert seen["odom"] == list(range(50))
        assert seen["camera/image"] == sorted(set(seen["camera/image"]))
        assert len(seen["camera/image"]) > 25
        assert len(found) == len(seen["odom"]) + len(seen["camera/image"])
        assert subscription.missed <= 50 - len(seen["camera/image"])


def test_a_handler_that_raises_does_not_end_a_subscription(caplog):
    with pair() as (first, second), Stream(first, "bot/odom", ODOMETRY) as stream:
        found: list[bytes] = []

        def handler(message: Received) -> None:
            found.append(message.data)
            if len(found) == 1:
                raise ValueError("the first one")

        with subscribe_stream(second, "bot/odom", handler) as subscription:
            time.sleep(0.1)
            stream.put(b"1")
            stream.put(b"2")
            until(lambda: len(found) == 2, "the last value and its change")
        assert subscription.failed == 1
    assert "stream bot/odom: the handler failed (1 so far)" in caplog.text


def test_requests_are_answered_or_say_why_not():
    def handler(payload: bytes) -> bytes:
        if payload == b"bad":
            raise ValueError("no checkpoint there")
        if payload == b"slow":
            time.sleep(0.4)
        return payload[::-1]

    with pair() as (first, second), serve(first, "bot/learner/command", handler):
        time.sleep(0.1)
        assert call(second, "bot/learner/command", b"abc") == b"cba"
        assert call(first, "bot/learner/command") == b""
        with pytest.raises(Refused, match="bot/learner/command: ValueError: no checkpoint there"):
            call(second, "bot/learner/command", b"bad")
        with pytest.raises(NoAnswer, match=r"no answer within 0.1 s"):
            call(second, "bot/learner/command", b"slow", timeout_s=0.1)
        with pytest.raises(NoAnswer, match="bot/nobody: nobody answers; start the agent"):
            call(second, "bot/nobody")


def test_agents_are_seen_to_come_and_go():
    with pair() as (first, second):
        seen: list[tuple[str, bool]] = []
        token = announce(first, "bot", "learner")
        with watch(second, "bot", lambda agent, here: seen.append((agent, here))):
            until(lambda: seen == [("learner", True)], "the learner")
            assert present(second, "bot") == {"learner"}
            other = announce(first, "bot", "robot")
            token.undeclare()
            until(lambda: len(seen) == 3, "its going and coming")
            assert sorted(seen[1:]) == [("learner", False), ("robot", True)]
            assert present(second, "bot2") == set()
            other.undeclare()


def agent(endpoint: str) -> None:
    """A process that publishes until it is killed."""
    with open_session(endpoint) as session, Stream(session, "bot/odom", ODOMETRY) as stream:
        announce(session, "bot", "robot")
        while True:
            stream.put(b"x")
            time.sleep(0.005)


def test_a_killed_process_is_seen_to_go_and_its_successor_s_messages_come():
    endpoint = free_endpoint()
    with open_session(endpoint) as session:
        seen: list[bool] = []
        found: list[Received] = []
        with (
            watch(session, "bot", lambda _agent, here: seen.append(here)),
            subscribe_stream(session, "bot/odom", found.append) as subscription,
        ):
            for run in (1, 2):
                process = spawn.Process(target=agent, args=(endpoint,), daemon=True)
                process.start()
                found.clear()
                until(lambda: len(found) > 10, "messages of the other process", timeout_s=20.0)
                process.kill()
                process.join()
                until(lambda run=run: len(seen) == 2 * run, "its coming and going")
            assert seen == [True, False] * 2
            assert subscription.missed == 0


CLOSING = """
import sys, time
from agents.transport import *
session = open_session(sys.argv[1])
kept = [
    subscribe_latest(session, "bot/a", id), subscribe_stream(session, "bot/b", id),
    subscribe_state(session, "bot/c", id),
    subscribe_all(session, "bot", lambda m: time.sleep(0.1)),
    watch(session, "bot", lambda agent, here: None), serve(session, "bot/d", bytes), announce(session, "bot", "x"),
]
stream = Stream(session, "bot/b", "")
for _ in range(100):
    stream.put(b"")
print(time.monotonic(), flush=True)
"""


@pytest.mark.parametrize("ending", ["", "session.close()\n", "for part in kept[:6]: part.close()\nsession.close()\n"])
def test_a_process_ends_at_once_however_much_is_left_open(ending):
    run = subprocess.run(
        [sys.executable, "-c", CLOSING + ending, free_endpoint()],
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    took_s = time.monotonic() - float(run.stdout.splitlines()[-1])
    assert run.returncode == 0, run.stderr
    assert took_s < 1.0


def test_closing_is_quick_with_a_busy_handler():
    with pair() as (first, second), Stream(first, "bot/odom", ODOMETRY) as stream:
        busy = threading.Event()
        subscription = subscribe_stream(second, "bot/odom", lambda _message: busy.set() or time.sleep(5))
        time.sleep(0.1)
        stream.put(b"x")
        assert busy.wait(5)
        before_s = time.monotonic()
        subscription.close()
        first.close()
        second.close()
        assert time.monotonic() - before_s < 0.9
        subscription.close()  # as the end of the process does, while the handler is still busy
