"""The Mighty Thymio of the paper (Nava et al. 2019, section IV-A), simulated with rays alone: no display, no GL.

A scenario (`configs/scenarios/*.toml`) and a seed give a layout; the layout gives the world that rays meet and the
footprints that stop the body; body, proximity sensors and camera, and people who walk about, together are
`SimulatedRobot`.
"""

from agents.robots.simulated.robot import Observation, SimulatedRobot
from agents.robots.simulated.scenario import Scenario, load_scenario

__all__ = ["Observation", "Scenario", "SimulatedRobot", "load_scenario"]
