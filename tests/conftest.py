"""What holds for all tests: one thread for training, as the learner has it, and examples that do not depend on luck."""

import os

import pytest
import torch
from hypothesis import settings

torch.set_num_threads(1)

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--screenshots", metavar="FOLDER", help="let the tests of the dashboard take the pictures of the docs there"
    )


@pytest.fixture(autouse=True)
def _compiled_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test that runs a live agent leaves no process behind that goes on without kernels."""
    monkeypatch.setattr("replay.compiling._waiting", True)
    monkeypatch.setattr("replay.compiling._wanted", True)
