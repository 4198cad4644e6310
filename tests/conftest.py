"""What holds for all tests: one thread for training, as the learner has it, and examples that do not depend on luck."""

import os
import signal

import pytest
import torch
from hypothesis import settings

from agents.commands.train import remember, trained
from agents.experiments.drives import Drive
from agents.experiments.settings import robot_of, scenario
from llrp_online.configuration import load
from tests.agents.processes import ROOT, quick_configuration

torch.set_num_threads(1)
# What a script starts in the background is deaf to Ctrl-C, and so would be all that tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--screenshots", metavar="FOLDER", help="let the tests of the dashboard take the pictures of the docs there"
    )


@pytest.fixture(autouse=True)
def _compiled_at_once(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A test that runs a live agent leaves no process behind that goes on without kernels, and finds them compiled."""
    monkeypatch.setattr("replay.compiling._waiting", True)
    monkeypatch.setattr("replay.compiling._wanted", True)
    if request.node.get_closest_marker("live"):
        request.getfixturevalue("_kernels_of_agents")


@pytest.fixture(scope="session")
def _kernels_of_agents(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Compiled once for this processor: else the first live tests of a new clone would time out waiting for them."""
    folder = tmp_path_factory.mktemp("kernels")
    for path in (ROOT / "configs" / "thymio.toml", quick_configuration(folder)):
        configuration = load(path)
        drive = Drive(robot_of(configuration), scenario("tiles"), 0, 0.2).recorded(folder)
        trained(configuration, remember(configuration, [drive]), 1)
