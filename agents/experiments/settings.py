"""The robots and arenas of `configs/`, as plain values."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agents.robots.simulated import load_scenario
from llrp_online.configuration import RobotConfiguration, load

#: Seeds of held-out layouts lie this far from those that are lived in.
HELD_OUT = 1000
CONFIGS = Path("configs")
#: What a learner is given that is to see on floors that it never saw: there the colours it knows mislead.
ELSEWHERE: Mapping[str, Any] = {"augmentation.colour": 0.5}
_LEARNING = {"memory", "network", "augmentation", "training", "compute", "publishing", "calibration"}
#: Tables and keys that came after results were kept: as they are by default, no result depends on their being told.
_YOUNGER = ("calibration", "augmentation.colour")


def configuration_of(robot: str) -> RobotConfiguration:
    """The configuration of a robot in `configs/`."""
    return load(CONFIGS / f"{robot}.toml")


def plain(configuration: RobotConfiguration) -> dict[str, Any]:
    """The whole configuration, as JSON values: what a trial depends on."""
    told, usual = configuration.model_dump(mode="json"), RobotConfiguration.model_fields
    for name in _YOUNGER:
        table, _, key = name.partition(".")
        default = usual[table].get_default().model_dump(mode="json")
        if not key and told[table] == default:
            del told[table]
        elif key and told[table][key] == default[key]:
            del told[table][key]
    return told


def robot_of(configuration: RobotConfiguration) -> dict[str, Any]:
    """What a drive depends on, as JSON values: all but how the robot learns, so that all its learners share drives."""
    return configuration.model_dump(mode="json", exclude=_LEARNING)


def scenario(name: str) -> dict[str, Any]:
    """A scenario of `configs/scenarios/`, as JSON values."""
    return load_scenario(CONFIGS / "scenarios" / f"{name}.toml").model_dump(mode="json")


def scenarios() -> tuple[str, ...]:
    """All their names."""
    return tuple(sorted(path.stem for path in (CONFIGS / "scenarios").glob("*.toml")))


def with_seed(configuration: RobotConfiguration, seed: int) -> RobotConfiguration:
    """The same learner with another seed."""
    return configuration.model_copy(update={"training": configuration.training.model_copy(update={"seed": seed})})


def changed(configuration: RobotConfiguration, changes: Mapping[str, Any]) -> RobotConfiguration:
    """The same with some keys changed, named `table.key` as in the TOML; each is checked as a file's would be."""
    tables = configuration.model_dump(mode="json")
    for name, value in changes.items():
        table, _, key = name.partition(".")
        if key not in tables[table]:
            raise ValueError(f"{name}: no such key; [{table}] has {', '.join(tables[table])}")
        tables[table][key] = value
    return RobotConfiguration.model_validate(tables)
