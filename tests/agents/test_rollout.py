"""Ranges to bits, and one robot driven in virtual time."""

import numpy as np
import pytest

from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.rollout import RangeBits, rollout
from llrp_online.configuration import load
from llrp_online.configuration.rig import ShortRange

CONFIGURATION = load("configs/thymio.toml")


def test_bits_come_in_the_order_of_the_configuration():
    assert RangeBits(CONFIGURATION.short_range)(np.array([0.02, np.inf, np.nan, 0.05, 0.2])).tolist() == [
        0,
        1,
        -1,
        0,
        1,
    ]


def test_a_threshold_is_no_hit_itself_and_may_point_either_way():
    sensors = [ShortRange(name="a", field="ranges[0]", below=0.1), ShortRange(name="b", field="ranges[0]", above=0.1)]
    assert RangeBits(sensors)(np.array([0.1])).tolist() == [0, 0]
    assert RangeBits(sensors)(np.array([0.09])).tolist() == [1, 0]
    assert RangeBits(sensors)(np.array([np.inf])).tolist() == [0, 1]


def test_a_field_the_robot_does_not_give_is_refused():
    with pytest.raises(ValueError, match=r"short_range 'a': field = 'range', but .* expected `ranges\[0\]`"):
        RangeBits([ShortRange(name="a", field="range", below=0.1)])


class Recorder:
    """A controller that notes what it is given and drives a little faster each time."""

    def __init__(self):
        self.calls = []

    def command(self, t_ns, odometry_pose, bits, prediction):
        self.calls.append((t_ns, odometry_pose, bits, prediction))
        return 0.001 * len(self.calls), 0.0


def test_every_tick_is_shown_to_the_controller_and_its_command_drives_the_next():
    assert CONFIGURATION.simulation is not None
    simulation = CONFIGURATION.simulation.model_copy(update={"wheel_acceleration_m_s2": 100.0})
    robot = SimulatedRobot(simulation, load_scenario("configs/scenarios/tiles.toml"), 0, None)
    recorder = Recorder()
    seen = list(rollout(robot, recorder, CONFIGURATION, 1.0))
    assert len(seen) == 20
    assert [call[0] for call in recorder.calls][: len(seen)] == [one.t_ns for one in seen]
    np.testing.assert_allclose([one.twist[0] for one in seen], 0.001 * np.arange(20), atol=1e-12)
    bits = recorder.calls[0][2]
    assert (bits.shape, bits.dtype) == ((5,), np.int8)
    assert recorder.calls[0][3] is None


def test_a_robot_without_a_simulation_is_refused():
    robot = SimulatedRobot(CONFIGURATION.simulation, load_scenario("configs/scenarios/tiles.toml"), 0, None)
    real = CONFIGURATION.model_copy(update={"simulation": None})
    with pytest.raises(ValueError, match=r"'thymio'.*\[simulation\]"):
        next(rollout(robot, Recorder(), real, 1.0))
