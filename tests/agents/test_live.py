"""The running system: agents as processes that meet on Zenoh, told to do things, killed, and told to end."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from agents import messages, topics, weights
from agents.agent import PARENT
from agents.transport import Frames, NoAnswer, Refused, State, subscribe_latest
from llrp_online import checkpoint
from llrp_online.configuration import load
from replay.recording import read
from tests.agents.processes import ROOT, WAIT_S, Agents, patience_s, quick_configuration, until

pytestmark = pytest.mark.live

SHARED = Path("/dev/shm")
ALL = ("learner", "perceiver", "recorder", "controller", "robot")


def bring_up(agents: Agents, *names: str, behaviour: str = "explore") -> None:
    """Those of them that are not up; the robot last, so that nobody misses its first message."""
    words = {
        "learner": ("learn", "--output", str(agents.folder / "run"), "--json"),
        "perceiver": ("perceive",),
        "recorder": ("record", "--output", str(agents.folder / f"{time.monotonic_ns()}.mcap")),
        "controller": ("control", "--behaviour", behaviour),
        "robot": ("robot", "--speed", "4"),
    }
    asleep = [name for name in names if not agents.is_up(name)]
    for name in sorted(asleep, key=lambda name: name == "robot"):
        if name == "robot":
            agents.wait_present(*(other for other in asleep if other != "robot"))
        agents.start(name, *words[name])
    agents.wait_present(*names)


def has_learned(agents: Agents) -> bool:
    learner = agents.learner
    return learner is not None and learner.steps > 3 and learner.version is not None and learner.loss is not None


@pytest.fixture(scope="module")
def shared_before() -> set[str]:
    return {path.name for path in SHARED.glob("*")}


@pytest.fixture(scope="module")
def agents(tmp_path_factory, shared_before) -> Iterator[Agents]:
    folder = tmp_path_factory.mktemp("live")
    with Agents(folder, quick_configuration(folder)) as running:
        yield running
    assert {path.name for path in SHARED.glob("*")} == shared_before


def ask(agents: Agents, command: str, **arguments: object) -> object:
    return json.loads(agents.ask(json.dumps({"command": command, **arguments}).encode()))["result"]


def test_labels_weights_and_predictions_flow(agents):
    bring_up(agents, *ALL)
    until(lambda: has_learned(agents), "training steps and weights")
    until(lambda: all(agents.counts.values()), "labels, weights and predictions")
    until(lambda: agents.perceiver is not None and agents.perceiver.frames > 3, "the perceiver's status")
    assert agents.perceiver.version is not None
    assert agents.perceiver.p50_ms < 1000
    until(lambda: sum(agents.learner.known), "closed frames with known labels")
    assert agents.is_driving()


def test_odometry_and_range_reach_the_learner_without_loss(agents):
    bring_up(agents, *ALL)
    lived_s = agents.learner.robot_s
    until(lambda: agents.learner.robot_s > lived_s + 4, "four seconds of the robot's life")
    lost = {what: n for what, n in agents.learner.drops.items() if what.startswith(("odom", "range", "reading"))}
    assert lost == {}
    assert not any("too slow" in what for what in agents.learner.drops)
    assert agents.missed["odom"].missed == agents.missed["range"].missed == 0
    assert agents.learner.backlog < 1000
    assert set(agents.learner.sizes) >= {"frames", "readings", "odometry", "recent", "memory"}


def test_the_learner_obeys(agents, tmp_path):
    bring_up(agents, *ALL)
    until(lambda: has_learned(agents), "training steps")
    assert ask(agents, "pause") is True
    until(lambda: agents.learner.paused, "the pause in its status")
    steps, lived_s = agents.learner.steps, agents.learner.robot_s
    until(lambda: agents.learner.robot_s > lived_s + 4, "life while it is paused")
    assert agents.learner.steps == steps
    assert ask(agents, "resume") is False
    until(lambda: agents.learner.steps > steps, "steps after the pause")

    saved = tmp_path / "saved"
    assert ask(agents, "save", path=str(saved)) == str(saved)
    kept = checkpoint.load(saved)[1]
    newest = agents.learner.version
    rolled = ask(agents, "roll_back", version=newest)
    assert rolled > newest
    until(lambda: agents.perceiver.version >= rolled, "the version rolled back to, at the perceiver")

    ask(agents, "reset")
    until(lambda: agents.learner.labelled < 60, "a learner that has forgotten")
    assert ask(agents, "load", path=str(saved)) == str(saved)
    until(lambda: agents.learner.steps >= kept["training"]["steps"], "the steps it had taken when it was saved")
    version = agents.learner.version or 0
    until(lambda: (agents.learner.version or 0) > version, "versions published after that")


@pytest.mark.parametrize(
    ("request_", "expected"),
    [
        (b"{", 'a request is JSON such as {"command": "pause"}'),
        (b"[]", "expected {\"command\": one of ['curves', 'explain'"),
        (b'{"command": "fly"}', "expected {\"command\": one of ['curves', 'explain'"),
        (b'{"command": ["pause"]}', 'expected {"command": one of'),
        (b'{"command": "save"}', "save: expected path (str) beside the command"),
        (b'{"command": "pause", "for_s": 3}', "pause: expected nothing else beside the command, got {'for_s': 3}"),
        (b'{"command": "roll_back", "version": "x"}', "roll_back: expected version (int)"),
        (b'{"command": "roll_back", "version": 0}', "version 0 is not kept; kept: ["),
        (b'{"command": "load", "path": "/nowhere/at/all"}', "/nowhere/at/all: no checkpoint"),
        (b'{"command": "save", "path": "/dev/null/x"}', "/dev/null"),
    ],
)
def test_a_wrong_command_is_refused_and_harms_nothing(agents, request_, expected):
    bring_up(agents, "learner")
    with pytest.raises(Refused) as refused:
        agents.ask(request_)
    assert expected in str(refused.value)
    assert ask(agents, "resume") is False


def test_the_learner_answers_those_who_look_on(agents):
    bring_up(agents, *ALL)
    until(lambda: has_learned(agents), "training steps")
    frames: list[int] = []
    with_prediction = subscribe_latest(
        agents.session,
        agents.key(topics.PREDICTION),
        lambda m: frames.append(messages.stamp_ns(m.type, m.data)),
    )
    until(lambda: len(frames) > 3, "predictions")
    with_prediction.close()
    t_ns = frames[-1]
    until(lambda: ask(agents, "labels", t_ns=[t_ns], ids=[-1])[0] is not None, "the learner's frame")
    [found] = ask(agents, "labels", t_ns=[t_ns], ids=[-1])
    explained = ask(agents, "explain", t_ns=t_ns)
    assert explained["t_ns"] == t_ns
    assert np.shape(explained["labels"]) == np.shape(found["labels"]) == (31, 5)
    until(lambda: ask(agents, "explain", t_ns=t_ns) is None, "its window closes")
    [closed] = ask(agents, "labels", t_ns=[t_ns], ids=[found["id"]])
    assert closed["id"] == found["id"]
    was, now = np.array(found["labels"]), np.array(closed["labels"])
    assert (now >= 0).sum() >= (was >= 0).sum()
    memory = ask(agents, "memory", pictures=5)
    assert 0 < len(memory["pictures"]) <= 5
    assert np.shape(memory["counts"]) == (31, 5, 2)
    curves = ask(agents, "curves")
    assert set(curves) == {"minutes", "drift_events"}


def test_a_stop_wins_and_holds_until_it_is_taken_back(agents):
    bring_up(agents, *ALL)
    until(agents.is_driving, "it drives")
    with State(agents.session, agents.key(topics.STOP), topics.STOP_TYPE) as word:
        word.put(messages.encode(messages.flag(True)))
        until(lambda: agents.robot.stopped, "the robot says that it stands")
        lived_s = agents.robot.robot_s
        until(lambda: agents.robot.robot_s > lived_s + 2, "time to roll out")
        metres, sent = agents.robot.metres, len(agents.commands)
        agents.kill("controller")
        bring_up(agents, "controller")
        until(lambda: agents.robot.robot_s > lived_s + 8, "time with a controller that came later")
        until(lambda: len(agents.commands) > sent + 20, "its commands")
        assert {(0.0, 0.0)} == set(agents.commands[sent:])
        assert agents.robot.metres == pytest.approx(metres, abs=1e-6)
        word.put(b"rubbish")
        word.put(messages.encode(messages.flag(False)))
        until(agents.is_driving, "it drives again")


def test_damaged_weights_are_refused_and_counted(agents):
    bring_up(agents, *ALL)
    until(lambda: agents.perceiver is not None and agents.perceiver.version is not None, "weights")
    ask(agents, "pause")  # so that no version of its own comes between
    version = agents.perceiver.version
    shapes = dict(checkpoint_shapes(agents))
    worthless = {name: np.full(shape, np.nan, np.float32) for name, shape in shapes.items()}
    with State(agents.session, agents.key(topics.WEIGHTS), "") as bus:
        others = weights.encode({"a": np.ones(1)}, 901)
        for count, damaged in enumerate((b"", b"rubbish" * 9, weights.encode(worthless, 900), others), 1):
            bus.put(damaged)
            until(lambda n=count: agents.perceiver.drops.get("weights: refused", 0) >= n, "the refusal")
    predicted = agents.counts["prediction"]
    until(lambda: agents.counts["prediction"] > predicted + 3, "predictions with the weights it has")
    assert agents.perceiver.version < 900
    assert agents.perceiver.version >= version
    assert "weights refused, going on with version" in agents.said("perceiver")
    ask(agents, "resume")


def checkpoint_shapes(agents: Agents) -> Iterator[tuple[str, tuple[int, ...]]]:
    path = agents.folder / "shapes"
    ask(agents, "save", path=str(path))
    for name, array in checkpoint.load(path)[0]["weights"].items():
        yield name, array.shape


def test_a_prediction_that_is_none_moves_nobody(agents):
    """NaN is above no threshold: a controller that took it would see a clear way everywhere."""
    bring_up(agents, "perceiver", "robot")
    configuration = load(agents.config)
    targets, sensors = configuration.targets.build().poses, configuration.sensors
    if agents.is_up("controller"):
        agents.end("controller")
    agents.kill("perceiver")
    agents.start("controller", "control", "--behaviour", "avoid")
    agents.wait_present("controller")
    blind = np.full((len(targets), len(sensors)), np.nan, np.float32)
    until(lambda: agents.robot is not None, "the robot's first word")
    heard = len(agents.commands)
    with Frames(agents.session, agents.key(topics.PREDICTION), topics.CLOUD_TYPE) as bus:

        def send_and_count() -> bool:
            t_ns = round((agents.robot.robot_s + 1) * 1e9)
            bus.put(messages.encode(messages.prediction(t_ns, targets, sensors, blind)))
            bus.put(b"rubbish")
            return len(agents.commands) > heard + 20

        until(send_and_count, "commands")
    assert set(agents.commands[heard:]) == {(0.0, 0.0)}
    agents.end("controller")


def test_there_can_be_only_one_of_each(agents):
    bring_up(agents, *ALL)
    seconds = {
        "learner": ("learn", "--output", str(agents.folder / "second")),
        "perceiver": ("perceive",),
        "controller": ("control",),
        "robot": ("robot",),
    }
    for name, words in seconds.items():
        agents.start(f"second {name}", *words)
    for name in seconds:
        process = agents.processes.pop(f"second {name}")
        assert process.wait(WAIT_S) == 1
        said = agents.said(f"second {name}")
        assert f"thymio has a {name} already at {agents.endpoint}" in said
        assert "end that one first, or give this one another --endpoint" in said
        assert "Traceback" not in said
    agents.wait_present(*ALL)


def test_the_perceiver_goes_on_when_the_learner_is_killed_and_a_new_one_begins(agents):
    bring_up(agents, *ALL)
    until(lambda: agents.perceiver is not None and agents.perceiver.version is not None, "weights")
    agents.kill("learner")
    with pytest.raises(NoAnswer, match="nobody answers; start the agent that serves it"):
        agents.ask(b'{"command": "pause"}', timeout_s=2.0)
    version, predicted = agents.perceiver.version, agents.counts["prediction"]
    until(lambda: agents.counts["prediction"] > predicted + 20, "predictions without a learner")
    assert agents.perceiver.version >= version
    bring_up(agents, "learner")
    until(lambda: has_learned(agents), "a new learner, in the midst of it")


def test_the_robot_stops_when_its_controller_is_killed(agents):
    bring_up(agents, "perceiver", "robot")
    if agents.is_up("controller"):
        agents.end("controller")
    bring_up(agents, "controller", behaviour="blind")
    until(agents.is_driving, "a robot that drives")
    agents.kill("controller")
    until(lambda: not agents.is_driving(), "the watchdog")
    assert not agents.is_driving()  # and it stays there


def test_the_controller_stops_the_robot_when_predictions_stop(agents):
    bring_up(agents, "learner", "perceiver", "robot")
    if agents.is_up("controller"):
        agents.end("controller")
    predicted = agents.counts["prediction"]
    until(lambda: agents.counts["prediction"] > predicted, "predictions")
    bring_up(agents, "controller", behaviour="avoid")
    heard = len(agents.commands)
    until(lambda: any(command != (0.0, 0.0) for command in agents.commands[heard:]), "a command to move")
    agents.kill("perceiver")
    until(lambda: len(agents.commands) > 20 and set(agents.commands[-20:]) == {(0.0, 0.0)}, "commands to stand still")
    bring_up(agents, "perceiver")  # which gets the newest weights though none are published now
    predicted = agents.counts["prediction"]
    until(lambda: agents.counts["prediction"] > predicted, "predictions again")
    agents.end("controller", signal.SIGINT)


def test_everything_ends_in_time_and_whole(agents):
    before = agents.learner  # of one that may have been ended meanwhile
    bring_up(agents, *ALL)
    until(lambda: agents.learner is not before and has_learned(agents), "something to save")
    number = {"learner": signal.SIGTERM, "perceiver": signal.SIGINT, "recorder": signal.SIGINT}
    for name in ALL:
        agents.end(name, number.get(name, signal.SIGTERM))
    tensors, manifest = checkpoint.load(agents.folder / "run" / "checkpoint")
    assert manifest["training"]["steps"] > 0
    assert len(tensors["memory"]["ids"]) > 0
    assert json.loads(agents.said("learner").splitlines()[-1])["steps"] == manifest["training"]["steps"]
    for recording in agents.folder.glob("*.mcap"):
        reader = read(recording)
        assert reader.report.finished
        assert sum(1 for _ in reader) > 0


def test_an_agent_ends_when_whoever_started_it_is_killed(tmp_path):
    program = """
    import os, subprocess, sys, time
    child = subprocess.Popen([sys.executable, "-m", "agents.cli", *sys.argv[1:]],
                             env={**os.environ, "LLRP_PARENT": str(os.getpid())})
    print(child.pid, flush=True)
    time.sleep(1000)
    """
    with Agents(tmp_path, quick_configuration(tmp_path)) as agents:
        words = ("control", "--config", str(agents.config), "--endpoint", agents.endpoint)
        parent = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(program), *words], stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
        try:
            child = int(parent.stdout.readline())
            agents.wait_present("controller")
            parent.kill()
            agents.wait_gone("controller")
            until(lambda: not Path(f"/proc/{child}/exe").exists(), "the agent's end", patience_s() + 1)
        finally:
            parent.kill()
            parent.communicate()


def test_interrupted_while_it_starts_an_agent_says_nothing(tmp_path):
    for number in (signal.SIGINT, signal.SIGTERM):
        process = subprocess.Popen(
            [sys.executable, "-m", "agents.cli", "learn", "--config", "configs/thymio.toml", "--output", str(tmp_path)],
            stderr=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, PARENT: str(os.getpid())},
            cwd=ROOT,
        )
        # In the midst of its imports, by the modules it has mapped.
        until(lambda pid=process.pid: "numpy" in Path(f"/proc/{pid}/maps").read_text(), "its imports")
        process.send_signal(number)
        out, err = process.communicate(timeout=WAIT_S)
        assert process.returncode == (130 if number == signal.SIGINT else -number)
        assert (out, err) == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("order", [ALL, ALL[::-1]], ids=["robot last", "robot first"])
def test_agents_come_in_any_order_and_end_by_any_signal(tmp_path, number, order):
    with Agents(tmp_path, quick_configuration(tmp_path)) as agents:
        for name in order:
            bring_up(agents, name)
        until(lambda: has_learned(agents) and all(agents.counts.values()), "weights and predictions")
        assert not any("never came" in what and not what.startswith("camera") for what in agents.learner.drops)
        for name in order:
            agents.end(name, number)


@pytest.mark.slow
def test_a_robot_that_is_killed_and_begins_anew_is_learned_from_again(tmp_path):
    """Its clock and its odometry begin again at zero."""
    with Agents(tmp_path, quick_configuration(tmp_path)) as agents:
        bring_up(agents, *ALL)
        until(lambda: has_learned(agents) and agents.learner.robot_s > 20, "twenty seconds of life")
        agents.kill("robot")
        bring_up(agents, "robot")
        frames, steps = agents.learner.frames, agents.learner.steps
        until(lambda: agents.learner.frames > frames + 50 and agents.learner.steps > steps + 5, "learning on")
        until(agents.is_driving, "a robot that drives")
        assert "the odometry clock jumped back" in agents.said("learner")
        for name in ALL:
            agents.end(name)


@pytest.mark.slow
def test_agents_go_on_when_their_hub_is_killed(tmp_path):
    with Agents(tmp_path, quick_configuration(tmp_path), hub=False) as agents:
        bring_up(agents, "recorder")  # the first to come is the hub
        bring_up(agents, "learner", "perceiver", "controller", "robot")
        until(lambda: has_learned(agents), "training steps")
        agents.kill("recorder")
        odometry, steps, predicted = agents.counts["odom"], agents.learner.steps, agents.counts["prediction"]
        until(lambda: agents.counts["odom"] > odometry + 100, "odometry without a hub")
        until(lambda: agents.learner.steps > steps and agents.counts["prediction"] > predicted, "learning on")
        assert agents.is_driving()
        bring_up(agents, "recorder")
        for name in ALL:
            agents.end(name)
    newest = max(tmp_path.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
    assert {"/thymio/odom", "/thymio/cmd_vel", "/thymio/prediction"} <= {message.topic for message in read(newest)}
