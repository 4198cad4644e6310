"""The controllers by name."""

from collections.abc import Callable

from agents.controllers import Controller
from agents.controllers.avoid import Avoid
from agents.controllers.blind import Blind
from agents.controllers.explore import Explore
from agents.controllers.random_walk import RandomWalk
from agents.controllers.reflex import Reflex
from llrp_online.configuration import RobotConfiguration

_MAKERS: dict[str, Callable[[RobotConfiguration, int], Controller]] = {
    "explore": lambda configuration, seed: Explore(configuration.control, seed),
    "walk": lambda configuration, seed: RandomWalk(configuration.control, seed),
    "avoid": lambda configuration, seed: Avoid(
        configuration.control, configuration.targets.build(), configuration.sensors, seed
    ),
    "reflex": lambda configuration, _seed: Reflex(configuration.control),
    "blind": lambda configuration, seed: Blind(configuration.control, seed),
}

#: Name -> what it does.
BEHAVIOURS = {
    "explore": "the paper's data acquisition: every obstacle from five sides",
    "walk": "random walk on the short-range sensors",
    "avoid": "on predictions alone",
    "reflex": "on the short-range sensors alone",
    "blind": "random turning, without any sense",
}


def controller(name: str, configuration: RobotConfiguration, seed: int) -> Controller:
    """The controller of that name."""
    return _MAKERS[name](configuration, seed)
