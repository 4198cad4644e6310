"""The robots and arenas of `configs/`, as plain values."""

from pathlib import Path
from typing import Any

from agents.robots.simulated import load_scenario
from llrp_online.configuration import RobotConfiguration, load

CONFIGS = Path("configs")


def configuration_of(robot: str) -> RobotConfiguration:
    """The configuration of a robot in `configs/`."""
    return load(CONFIGS / f"{robot}.toml")


def scenario(name: str) -> dict[str, Any]:
    """A scenario of `configs/scenarios/`, as JSON values."""
    return load_scenario(CONFIGS / "scenarios" / f"{name}.toml").model_dump(mode="json")


def scenarios() -> tuple[str, ...]:
    """All their names."""
    return tuple(sorted(path.stem for path in (CONFIGS / "scenarios").glob("*.toml")))
