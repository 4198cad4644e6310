"""The controllers by name."""

from collections.abc import Callable

from agents.controllers import Controller
from agents.controllers.avoid import Avoid
from agents.controllers.blind import Blind
from agents.controllers.curious import Curious
from agents.controllers.explore import Explore
from agents.controllers.random_walk import RandomWalk
from agents.controllers.reflex import Reflex
from agents.controllers.seek import Seek
from llrp_online.configuration import RobotConfiguration


def _avoid(configuration: RobotConfiguration, seed: int) -> Avoid:
    return Avoid(configuration.control, configuration.targets.build(), configuration.sensors, seed)


def _curious(configuration: RobotConfiguration, seed: int) -> Curious:
    return Curious(configuration.control, _avoid(configuration, seed), Reflex(configuration.control))


_MAKERS: dict[str, Callable[[RobotConfiguration, int], Controller]] = {
    "explore": lambda configuration, seed: Explore(configuration.control, seed),
    "walk": lambda configuration, seed: RandomWalk(configuration.control, seed),
    "seek": lambda configuration, seed: Seek(configuration.control, seed),
    "avoid": _avoid,
    "curious": _curious,
    "reflex": lambda configuration, _seed: Reflex(configuration.control),
    "blind": lambda configuration, seed: Blind(configuration.control, seed),
}

#: Name -> what it does.
BEHAVIOURS = {
    "explore": "the paper's data acquisition: every obstacle from five sides",
    "walk": "random walk on the short-range sensors",
    "seek": "up to what it has not met yet, along lines that it has not driven yet",
    "avoid": "on predictions alone",
    "curious": "on predictions, but a few times a minute up to something that it feels",
    "reflex": "on the short-range sensors alone",
    "blind": "random turning, without any sense",
}


def controller(name: str, configuration: RobotConfiguration, seed: int) -> Controller:
    """The controller of that name."""
    return _MAKERS[name](configuration, seed)
