"""Simulated drives that trials share: each recorded once, whoever asks first, and never half there."""

import fcntl
import hashlib
import json
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from agents.robots.simulated.scenario import Scenario
from agents.simulated_drive import record_drive
from llrp_online.configuration import RobotConfiguration


@dataclass(frozen=True)
class Drive:
    """A drive in virtual time, wholly told by plain values: the same bytes wherever it is recorded.

    Attributes:
        configuration: the robot's, as JSON values.
        scenario: the arena's, as JSON values.
        seed: of layout, noise and controller.
        minutes: of the robot's time.
        behaviour: the controller's name.
    """

    configuration: Mapping[str, Any]
    scenario: Mapping[str, Any]
    seed: int
    minutes: float
    behaviour: str = "explore"

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> Self:
        """From a trial's parameters."""
        return cls(**parameters)

    def as_json(self) -> dict[str, Any]:
        """For a trial's parameters."""
        return asdict(self)

    def recorded(self, folder: Path) -> Path:
        """The recording, from the folder that trials share, or made now."""
        told = json.dumps(self.as_json(), sort_keys=True).encode()
        path = folder / f"{self.behaviour}-{hashlib.sha256(told).hexdigest()[:12]}.mcap"
        folder.mkdir(parents=True, exist_ok=True)
        with _alone(path.with_suffix(".lock")):
            if not path.exists():
                part = path.with_suffix(".part")
                part.unlink(missing_ok=True)
                record_drive(
                    RobotConfiguration.model_validate(self.configuration),
                    Scenario.model_validate(self.scenario),
                    self.seed,
                    self.minutes,
                    part,
                    self.behaviour,
                )
                part.rename(path)
        return path


@contextmanager
def _alone(lock: Path) -> Generator[None]:
    """One process at a time; a process that dies lets go."""
    with lock.open("wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
