"""The paper's second robot, simulated: a Pioneer on a black and white floor (Nava et al. 2019, section V-C).

Nothing stands on the floor and nothing casts a shadow, so a picture is one look-up a pixel, and needs neither GL nor
physics. A world (`configs/worlds/pioneer.toml`) and a seed give the floor and the drive; poses on it give pictures and
what the floor sensor reads.
"""

from agents.robots.pioneer.drive import Step, drive
from agents.robots.pioneer.eyes import Eyes, Pinhole
from agents.robots.pioneer.floor import Floor
from agents.robots.pioneer.world import PioneerWorld, load_world

__all__ = ["Eyes", "Floor", "Pinhole", "PioneerWorld", "Step", "drive", "load_world"]
