"""Simulated drives that trials share."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from agents.experiments.shared import digest, made_once
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

        def record(part: Path) -> None:
            form, arena = RobotConfiguration.model_validate(self.configuration), Scenario.model_validate(self.scenario)
            record_drive(form, arena, self.seed, self.minutes, part, self.behaviour)

        return made_once(folder / f"{self.behaviour}-{digest(self.as_json())}.mcap", record)
