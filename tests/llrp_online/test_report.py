import base64
import dataclasses
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from llrp_online.configuration import RobotConfiguration, load
from llrp_online.metrics import Score
from llrp_online.report import Example, Report, page, versions, write

CONFIGURATION = load(Path(__file__).parents[2] / "configs" / "drone.toml")
TARGETS = CONFIGURATION.targets.build().poses
SHAPE = (len(TARGETS), len(CONFIGURATION.sensors))
HOSTILE = '<script>alert("1")</script> & co'
VOID = {"meta", "img", "br", "link"}


class Page(HTMLParser):
    """Notes tags, text and whether all that opens closes."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.tags, self.text, self.links = [], [], [], "", []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        attributes = dict(attrs)
        self.links += [attributes[name] for name in ("src", "href") if name in attributes]
        if tag == "img":
            self.images.append(attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def score(seed=0):
    rng = np.random.default_rng(seed)
    labels = rng.integers(-1, 2, (60, *SHAPE)).astype(np.int8)
    labels[:, -1, 0] = 0
    return Score.of(rng.random(labels.shape), labels, TARGETS, CONFIGURATION.sensors, rounds=5)


def empty():
    nothing = np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((len(TARGETS), 2), np.int64)
    return Report("Nothing yet", CONFIGURATION, 3, versions(), [], [], {}, [], *nothing)


def full():
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, CONFIGURATION.picture_shape, np.uint8)
    labels = rng.integers(-1, 2, SHAPE).astype(np.int8)
    return dataclasses.replace(
        empty(),
        title=HOSTILE,
        facts=[("robot minutes", "6.2"), (HOSTILE, HOSTILE)],
        curve=[(1, None, float("nan"), 0), (2, 0.7, 0.8, 12)],
        scores={"held out": score(), HOSTILE: score(1)},
        examples=[Example(picture, labels, rng.random(SHAPE, np.float32), HOSTILE)],
        path=np.cumsum(rng.normal(size=(30, 3)), 0),
        fired=rng.normal(size=(4, 2)),
        known=rng.integers(0, 50, (len(TARGETS), 2)),
    )


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "new" / "run"
    assert write(full(), folder) == folder / "report.html"
    return folder


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(written):
    found = Page((written / "report.html").read_text(encoding="utf-8"))
    assert len(found.images) == 1 + 1 + 2 * 2 + 1 + 1
    for image in found.images:
        kind, data = image["src"].split(",", 1)
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
        assert len(image["alt"]) > 20
    assert all(link.startswith("data:") for link in found.links)
    assert "script" not in found.tags
    assert found.text.count(HOSTILE) >= 5  # escaped, so it arrives as text
    assert "prefers-color-scheme: dark" in found.text


def test_every_score_has_a_table_of_every_cell(written):
    text = Page((written / "report.html").read_text(encoding="utf-8")).text
    for one in full().scores.values():
        auc, low, high = (float(values[2, 1]) for values in (one.auc, one.low, one.high))
        assert f"{auc:.3f} [{low:.2f}, {high:.2f}] {one.n_pos[2, 1]}/{one.n_neg[2, 1]}" in text
        assert f"AUC {one.pooled_auc:.3f}" in text
        assert f"0/{one.n_neg[-1, 0]}" in text


def test_json_holds_the_schema_and_comes_back(written):
    text = (written / "report.json").read_text(encoding="utf-8")
    found = json.loads(text, parse_constant=lambda name: pytest.fail(f"JSON holds {name}"))
    assert list(found) == ["config", "seed", "versions", "facts", "learning_curve", "scores"]
    assert RobotConfiguration.model_validate(found["config"]) == CONFIGURATION
    assert found["seed"] == 3
    assert found["versions"] == versions()
    assert found["facts"] == [["robot minutes", "6.2"], [HOSTILE, HOSTILE]]
    assert found["learning_curve"] == [
        {"minute": 1, "mean_auc_0_25_cm": None, "cells_0_25_cm": 0, "mean_auc_0_15_cm": None},
        {"minute": 2, "mean_auc_0_25_cm": 0.7, "cells_0_25_cm": 12, "mean_auc_0_15_cm": 0.8},
    ]
    assert set(found["scores"]) == {"held out", HOSTILE}
    one = found["scores"]["held out"]
    assert list(one) == ["targets", "sensors", "auc", "low", "high", "n_pos", "n_neg", "pooled_auc"]
    assert one == score().as_json()
    assert one["auc"][-1][0] is None
    assert np.array(one["n_neg"]).shape == SHAPE


def test_what_is_empty_is_left_out():
    found = Page(page(empty()))
    assert found.images == []
    assert found.tags.count("h2") == 1  # how to repeat it
    for title in ("Learning curve", "Where it went", "Known labels", "What it saw", "Score"):
        assert title not in found.text


def test_a_score_of_one_class_has_a_table_and_no_empty_figure():
    labels = np.zeros((5, *SHAPE), np.int8)
    nothing = Score.of(np.random.default_rng(0).random(labels.shape), labels, TARGETS, CONFIGURATION.sensors)
    found = Page(page(dataclasses.replace(empty(), scores={"quiet": nothing})))
    assert found.images == []
    assert "AUC undefined (n+ 0" in found.text
    assert "0/5" in found.text


def test_files_are_replaced_whole(tmp_path):
    write(empty(), tmp_path)
    before = (tmp_path / "report.json").read_text()
    broken = dataclasses.replace(full(), facts=[("fine", "until here")], curve=[(float("nan"), 0.5, 0.5, 1)])
    with pytest.raises(ValueError, match="JSON"):
        write(broken, tmp_path)
    assert (tmp_path / "report.json").read_text() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.json"]


def test_versions_name_what_shapes_the_numbers():
    found = versions()
    assert found["numpy"] == np.__version__
    assert all(found.values())
