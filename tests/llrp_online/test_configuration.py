import copy
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from llrp_online.configuration import ConfigurationError, RobotConfiguration, Thymio, load, validate
from llrp_online.configuration.running import Keys

ROOT = Path(__file__).parents[2]
TOML = """
[robot]
name = "bot"
[[camera]]
topic = "camera"
width = 16
height = 16
[[short_range]]
name = "left"
field = "ranges[1]"
below = 0.2
swap = "right"
[[short_range]]
name = "right"
field = "ranges[0]"
below = 0.2
swap = "left"
[targets]
kind = "line"
start_m = 0.0
stop_m = 1.0
step_m = 0.5
[labels]
position_tolerance_m = 0.1
"""


def fault(tmp_path, text: str) -> str:
    """What loading this text says, and that it names the file."""
    file = tmp_path / "bot.toml"
    file.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load(file)
    assert str(caught.value).startswith(f"{file}: ")
    return str(caught.value)


def changed(old: str, new: str) -> str:
    assert TOML.count(old) >= 1
    return TOML.replace(old, new, 1)


def camera(topic: str, **keys) -> dict:
    return {"topic": topic, "width": 16, "height": 16, **keys}


def sensor(name: str, **keys) -> dict:
    return {"name": name, "field": "ranges[0]", "below": 0.2, **keys}


def rig(**tables) -> RobotConfiguration:
    raw = {
        "robot": {"name": "bot"},
        "camera": [camera("front")],
        "short_range": [sensor("ahead")],
        "targets": {"kind": "line", "start_m": 0.0, "stop_m": 1.0, "step_m": 0.5},
        "labels": {"position_tolerance_m": 0.1},
    }
    return validate(copy.deepcopy({**raw, **tables}), RobotConfiguration, "bot.toml")


@pytest.mark.parametrize("path", sorted((ROOT / "configs").glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_configuration_loads(path):
    configuration = load(path)
    assert configuration.robot.name == path.stem
    assert len(configuration.targets.build()) >= 11
    assert configuration.labels.rule().window_s > 0
    # What a checkpoint keeps of it is the same configuration, but for how the robot is reached.
    kept = configuration.model_copy(update={"keys": Keys(), "thymio": Thymio()})
    assert validate(configuration.model_dump(mode="json"), RobotConfiguration, "again") == kept


def test_the_papers_targets_are_shipped():
    assert len(load(ROOT / "configs/thymio.toml").targets.build()) == 31
    assert len(load(ROOT / "configs/pioneer.toml").targets.build()) == 17 * 17


def test_what_is_left_out_has_defaults(tmp_path):
    file = tmp_path / "bot.toml"
    file.write_text(TOML)
    configuration = load(str(file))
    assert configuration.sensors == ["left", "right"]
    assert configuration.range_topics == ["range"]
    assert configuration.picture_shape == (16, 16, 3)
    assert configuration.odometry.topic == "odom"
    assert configuration.labels.rule().window == "fixed"
    assert configuration.training.seed == 0
    assert configuration.simulation is None


MISTAKES = {
    "an unknown key": (
        changed("position_tolerance_m", "positon_tolerance_m"),
        [
            "labels.positon_tolerance_m: unknown key (its value: 0.1)",
            "did you mean `position_tolerance_m`?",
            "allowed: gate_m, heading_tolerance_rad, position_tolerance_m, window, window_s",
            "labels.position_tolerance_m: missing",
        ],
    ),
    "an unknown key far from any": (TOML + "colour = 3\n", ["labels.colour: unknown key (its value: 3); allowed: "]),
    "a misspelt table": (TOML + "[trainign]\nbatch = 8\n", ["trainign: unknown key", "did you mean `training`?"]),
    "an unknown key in an array": (
        changed("below = 0.2", "bellow = 0.2"),
        ["short_range[0].bellow: unknown key", "did you mean `below`?"],
    ),
    "an unknown key of the targets": (
        changed("step_m", "step"),
        ["targets.step: unknown key (its value: 0.5); did you mean `step_m`?", "targets.step_m: missing"],
    ),
    "out of range": (changed("width = 16", "width = 4"), ["camera[0].width: got 4; ", "greater than or equal to 8"]),
    "not finite": (changed("0.1", "nan"), ["labels.position_tolerance_m: got nan; ", "finite"]),
    "no whole number": (changed("width = 16", "width = 16.5"), ["camera[0].width: got 16.5; ", "integer"]),
    "a text for a number": (changed("width = 16", 'width = "16"'), ["camera[0].width: got '16'; ", "integer"]),
    "a truth for a number": (changed("below = 0.2", "below = true"), ["short_range[0].below: got True; ", "number"]),
    "a number for a text": (changed('name = "left"', "name = 3"), ["short_range[0].name: got 3; ", "string"]),
    "a number for a table": ("memory = 3\n" + TOML, ["memory: got 3; "]),
    "a choice there is not": (
        TOML + '[memory]\npolicy = "lifo"\n',
        ["memory.policy: got 'lifo'; ", "'balanced', 'reservoir' or 'fifo'"],
    ),
    "a missing key": (changed("height = 16", ""), ["camera[0].height: missing"]),
    "a missing table": (changed("[robot]", "[roboter]"), ["robot: missing", "did you mean `robot`?"]),
    "a kind of targets there is not": (changed('"line"', '"lines"'), ["targets", "'lines'", "'line', 'grid', 'list'"]),
    "no kind of targets": (changed('kind = "line"', ""), ["targets.kind: missing", "line", "grid", "list"]),
    "targets that end before they begin": (
        changed("stop_m = 1.0", "stop_m = -1.0") + "[augmentation]\nflip = 0\n",
        ["targets", "start <= stop", "stop=-1.0"],
    ),
    "no threshold": (changed("below = 0.2", ""), ["short_range[0]: ", "exactly one of `below` and `above`"]),
    "two thresholds": (changed("below = 0.2", "below = 1\nabove = 2"), ["exactly one of `below` and `above`"]),
    "no field": (changed("ranges[1]", "ranges 1"), ["short_range[0]: field 'ranges 1'", "`ranges[3]`"]),
    "a name twice": (
        changed('name = "right"', 'name = "left"'),
        ["short_range name: each must be given once, got ['left']"],
    ),
    "no name for a key": (changed('"bot"', '"my bot"'), ["robot.name: got 'my bot'; "]),
    "no TOML": (TOML + "[labels\n", ["not valid TOML", "line 25"]),
}


@pytest.mark.parametrize(("text", "said"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_named_with_its_file_and_key(tmp_path, text, said):
    message = fault(tmp_path, text)
    for part in said:
        assert part in message


def test_all_mistakes_are_named_at_once(tmp_path):
    message = fault(tmp_path, changed("width = 16", "width = 4") + "[training]\nseeed = 1\nbatch = 0\n")
    assert "camera[0].width" in message
    assert "training.batch: got 0" in message
    assert "did you mean `seed`?" in message


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"none\.toml: cannot be read: No such file"):
        load(tmp_path / "none.toml")
    with pytest.raises(ConfigurationError, match="cannot be read: Is a directory"):
        load(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"\n')
    with pytest.raises(ConfigurationError, match=r"latin\.toml: not valid TOML"):
        load(tmp_path / "latin.toml")


def test_swaps_that_disagree_are_refused():
    with pytest.raises(ConfigurationError, match="'left': swap = 'wright' names none of"):
        rig(short_range=[sensor("left", swap="wright"), sensor("right", swap="left")])
    with pytest.raises(ConfigurationError, match="'left': swap = 'right', but 'right' has swap = 'right'"):
        rig(short_range=[sensor("left", swap="right"), sensor("right", swap="right")])
    with pytest.raises(ConfigurationError, match="'a': swap = 'b', but 'b' has swap = None"):
        rig(camera=[camera("a", swap="b"), camera("b")])


def test_cameras_must_share_one_size():
    with pytest.raises(ConfigurationError, match=r"one width and height, got \[\(16, 16\), \(32, 16\)\]"):
        rig(camera=[camera("a", swap="a"), camera("b", swap="b", width=32)])


NO_MIRROR = {
    "camera": {"camera": [camera("a"), camera("b")]},
    "short_range": {"short_range": [sensor("a", swap="a"), sensor("b")]},
    "targets": {"targets": {"kind": "list", "poses": [[0.5, 0.1, 0.0]]}},
}


@pytest.mark.parametrize("what", NO_MIRROR)
def test_a_flip_without_a_mirror_image_is_refused(what):
    with pytest.raises(ConfigurationError, match=rf"augmentation\.flip = 0\.5, but {what} has no mirror image"):
        rig(**NO_MIRROR[what])
    assert rig(**NO_MIRROR[what], augmentation={"flip": 0.0}).augmentation.flip == 0


def test_swaps_are_indices():
    found = rig(
        camera=[camera("a", swap="c"), camera("b", swap="b"), camera("c", swap="a")],
        short_range=[sensor("left", swap="right"), sensor("right", swap="left")],
    )
    np.testing.assert_array_equal(found.camera_swap(), [2, 1, 0])
    np.testing.assert_array_equal(found.sensor_swap(), [1, 0])
    assert found.picture_shape == (16, 16, 9)


def test_nothing_can_be_changed():
    configuration = rig()
    for table, key in (
        (configuration, "labels"),
        (configuration.memory, "store_mb"),
        (configuration.camera[0], "width"),
    ):
        with pytest.raises(ValidationError, match="frozen"):
            setattr(table, key, 1)
    # One configuration's defaults are not another's.
    configuration.control.directions_deg.append(99.0)
    assert 99.0 not in rig(control={}).control.directions_deg
