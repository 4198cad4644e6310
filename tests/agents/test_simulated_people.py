"""People: how they walk, and that robots see, feel and run into them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.robots.simulated.layout import Footprints, Layout
from agents.robots.simulated.people import START_M, People, Walker
from agents.robots.simulated.scenario import Person, Scenario, Surface
from llrp_online.configuration.running import Simulation

TILES = load_scenario("configs/scenarios/tiles.toml")
PERSON = Person(surface="green bottle")
PEOPLED = TILES.model_copy(update={"people": [PERSON]})
GREY = Surface(name="grey", pattern="plain", colours=("#808080", "#909090"), period_m=1.0)
IDEAL = Simulation(slip=0.0, bias=0.0, range_noise_m=0.0)
DT = 0.05
FAR_AWAY = (9.0, 9.0, 0.1)


def walker(*shapes, person=PERSON, seed=0):
    """Sets off from the origin along x."""
    return Walker(person, Footprints(list(shapes)), [0.0, 0.0], 0.0, np.random.default_rng(seed))


def gap_m(one, disc):
    return min(np.hypot(x - disc[0], y - disc[1]) - r - disc[2] for x, y, r in one.discs)


def test_with_nothing_in_the_way_a_person_walks_straight_on_at_their_speed():
    one = walker()
    for _ in range(40):
        one.step([FAR_AWAY], DT)
    np.testing.assert_allclose(one.legs_m, [[0.67, 0.0], [0.53, 0.0]], atol=1e-9)


def test_before_the_robot_they_stop_and_walk_on_when_it_is_gone():
    one, robot = walker(person=PERSON.model_copy(update={"patience_s": 60.0})), (0.4, 0.0, 0.055)
    for _ in range(100):
        one.step([robot], DT)
    stopped = one.legs_m
    assert PERSON.stop_m <= gap_m(one, robot) < PERSON.stop_m + PERSON.speed_m_s * DT
    one.step([FAR_AWAY], DT)
    np.testing.assert_allclose(one.legs_m - stopped, [[0.015, 0.0]] * 2, atol=1e-9)


def test_who_has_waited_long_enough_goes_elsewhere():
    one, robot = walker(), (0.4, 0.0, 0.055)
    ways = []
    for _ in range(160):
        before = one.legs_m
        one.step([robot], DT)
        ways.append(np.abs(one.legs_m - before).max())
    waiting = np.flatnonzero(np.array(ways) == 0)
    assert DT * len(waiting) == pytest.approx(PERSON.patience_s, abs=1.5 * DT)
    assert gap_m(one, robot) > 0.3


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_nobody_walks_into_anything_nor_nearer_to_the_robot_than_they_may(seed, layout_seed):
    layout = Layout.draw(PEOPLED, layout_seed)
    people, still = People(PEOPLED.model_copy(update={"people": [PERSON] * 2}), layout, seed), Footprints(layout.shapes)
    rng = np.random.default_rng(seed)
    robot = np.array([*layout.start[:2]])
    for _ in range(60):
        before = people.legs_m
        robot += rng.uniform(-0.02, 0.02, 2)
        disc = (*robot.tolist(), 0.055)
        people.step(disc, DT)
        gaps = [np.hypot(*(legs - robot).T).min() - 0.055 - PERSON.leg_m / 2 for legs in (before, people.legs_m)]
        if (people.legs_m != before).any():
            assert gaps[1] >= min(gaps[0], PERSON.stop_m) - 1e-12
        assert min(still.clearance_m(leg) for leg in people.legs_m) >= PERSON.leg_m / 2
        one, other = people.legs_m[:2], people.legs_m[2:]
        assert np.hypot(*(one[:, None] - other[None]).reshape(-1, 2).T).min() >= PERSON.leg_m


@pytest.mark.parametrize("name", ["cardboard", "grass", "tiles"])
def test_a_person_gets_about(name):
    scenario = load_scenario(f"configs/scenarios/{name}.toml")
    scenario = scenario.model_copy(update={"people": [PERSON.model_copy(update={"surface": scenario.arena.floor})]})
    people = People(scenario, Layout.draw(scenario, 0), seed=0)
    spots = []
    for _ in range(2400):
        people.step(FAR_AWAY, DT)
        spots.append(people.legs_m.mean(0))
    assert np.ptp(spots, 0).min() > 1.0  # from one end to the other, in both directions


def test_people_begin_away_from_the_robot_and_leave_the_layout_as_it_is():
    for seed in range(20):
        layout = Layout.draw(PEOPLED, seed)
        assert layout.shapes == Layout.draw(TILES, seed).shapes
        assert layout.start == Layout.draw(TILES, seed).start
        legs_m = People(PEOPLED, layout, seed).legs_m
        assert np.hypot(*(legs_m - layout.start[:2]).T).min() >= START_M


def test_a_crowd_that_finds_no_room_is_refused_with_a_way_out():
    crowd = PEOPLED.model_copy(update={"people": [PERSON] * 60})
    with pytest.raises(ValueError, match=r"no room for a person .* enlarge it"):
        People(crowd, Layout.draw(crowd, 0), 0)


LONELY = TILES.model_copy(
    update={
        "people": [PERSON.model_copy(update={"speed_m_s": 1e-6, "patience_s": 1e6})],
        "obstacles": [TILES.obstacles[-1].model_copy(update={"count": 1, "surfaces": ["plaster"]})],
    }
)


def test_a_leg_is_felt_seen_and_stops_the_body():
    """An arena with hardly anything else, and a person who stands still while the robot drives up to them."""
    robot = SimulatedRobot(IDEAL, LONELY, seed=0, picture=(64, 80))
    legs_m = People(LONELY, robot.layout, 0).legs_m
    leg_m = min(legs_m, key=lambda leg: np.hypot(*(leg - robot.layout.start[:2])))
    turn_towards(robot, leg_m)
    while not (seen := robot.step(0.15, 0.0)).collided:
        assert robot.step(0.15, 0.0).t_ns < 60e9
    x, y, yaw = seen.true_pose
    middle = np.array([x + IDEAL.centre_ahead_m * np.cos(yaw), y + IDEAL.centre_ahead_m * np.sin(yaw)])
    assert np.hypot(*(leg_m - middle)) - PERSON.leg_m / 2 == pytest.approx(IDEAL.radius_m, abs=1e-3)
    assert seen.ranges[2] < 0.005
    assert robot.collisions == 1
    pictures = [robot.step(0.0, 0.0).picture for _ in range(2)]
    red, green, _ = next(picture for picture in pictures if picture is not None).reshape(-1, 3).T.astype(float)
    assert (green > 1.3 * red).mean() > 0.3  # nothing else there is green


def turn_towards(robot, point):
    """In place, until it faces a point."""
    error = np.inf
    while abs(error) > 0.005:
        x, y, yaw = robot.step(0.0, 0.0).true_pose
        error = (np.arctan2(point[1] - y, point[0] - x) - yaw + np.pi) % (2 * np.pi) - np.pi
        assert robot.step(0.0, float(np.clip(4 * error, -1.0, 1.0))).t_ns < 60e9


def test_the_robot_is_never_inside_a_leg_on_a_wild_drive():
    scenario = TILES.model_copy(update={"people": [PERSON] * 3})
    robot, rng = SimulatedRobot(Simulation(), scenario, seed=1, picture=None), np.random.default_rng(0)
    for tick in range(1500):
        if tick % 20 == 0:
            command = rng.uniform([-0.1, -2.0], [0.2, 2.0])
        robot.step(*command)
        assert robot._body._clearance_m(robot._body.true_pose) >= -1e-8
    assert robot.collisions > 0


def test_the_same_seed_gives_the_same_walk_and_another_seed_another():
    def seen(seed):
        robot = SimulatedRobot(Simulation(), PEOPLED, seed, picture=(8, 10))
        return [robot.step(0.1, 0.2).ranges for _ in range(20)], robot._people.legs_m

    np.testing.assert_array_equal(seen(3)[0], seen(3)[0])
    np.testing.assert_array_equal(seen(3)[1], seen(3)[1])
    assert (seen(3)[1] != seen(4)[1]).any()


def test_faults_are_named():
    with pytest.raises(ValueError, match=r"apart_m: the legs would overlap; expected at least leg_m = 0\.08"):
        Person(surface="denim", apart_m=0.05)
    told = TILES.model_dump(mode="json") | {"people": [{"surface": "denim"}]}
    with pytest.raises(ValueError, match=r"people\[0\]\.surface: no surface is named 'denim'; allowed: carton"):
        Scenario.model_validate(told)
