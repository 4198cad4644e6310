"""What the dashboard keeps, without a browser and without a bus: pictures, past frames, the ground, who may ask."""

import numpy as np
import pytest

from agents import messages
from agents.dashboard.ground import Ground
from agents.dashboard.guard import is_allowed
from agents.dashboard.past import Pasts
from agents.dashboard.sights import Shot, Sights
from agents.transport import Received
from llrp_online.configuration import load
from llrp_online.events import OdometrySample, Reading
from replay.uncertainty import axes

CONFIGURATION = load("configs/thymio.toml")
SECOND = 1_000_000_000


def with_labels(**labels):
    changed = CONFIGURATION.labels.model_copy(update=labels)
    return CONFIGURATION.model_copy(update={"labels": changed})


def driven(configuration=CONFIGURATION, seconds=10.0, speed_m_s=0.1, covariance=None):
    """A straight drive at ten poses a second, with a reading for each."""
    ground = Ground(configuration)
    for tick in range(round(seconds * 10) + 1):
        t_ns = SECOND + tick * SECOND // 10
        pose = np.array([tick * speed_m_s / 10, 0.0, 0.0])
        ground.odometry(OdometrySample(t_ns, pose, None if covariance is None else tick * covariance))
        ground.reading(Reading(t_ns, "range", np.array([0, 0, int(tick == 50), 0, 0], np.int8)))
    return ground


def test_the_path_and_where_sensors_fired():
    ground = driven(speed_m_s=0.2)
    assert ground.pose == pytest.approx((2.0, 0.0, 0.0))
    assert ground.points == len(ground.path) == 101
    assert [point.joined for point in ground.path][:2] == [False, True]
    [fired] = ground.fired
    assert (fired.sensor, fired.x_m) == (2, pytest.approx(1.0))
    assert ground.moved_m(2.0) == pytest.approx(0.4)
    assert len(driven(speed_m_s=0.05).path) < 60  # a point a centimetre


def test_a_fixed_window_goes_by_the_clock():
    window = driven(with_labels(window_s=4.0)).window()
    assert window.back_s == pytest.approx(4.0)
    assert window.reached_m == pytest.approx(0.4)


def test_a_drift_window_ends_where_the_pose_is_no_longer_known():
    configuration = with_labels(window="drift", window_s=100.0, gate_m=0.01)
    growth = np.diag([4e-6, 1e-6, 0.0])  # a tick
    window = driven(configuration, covariance=growth).window()
    assert window.long_m == pytest.approx(2e-3 * np.sqrt(25), rel=1e-6)
    assert window.back_s == pytest.approx(2.5)
    assert window.short_m == pytest.approx(1e-3 * np.sqrt(25), rel=1e-6)
    assert axes(np.array([[4e-6, 0.0, 1e-6]]))[2] == pytest.approx(window.angle_rad)


def test_a_jump_ends_the_window_and_the_line():
    ground = driven()
    ground.odometry(OdometrySample(SECOND * 12, np.array([5.0, 5.0, 0.0])))
    assert ground.window().back_s == 0.0
    assert not ground.path[-1].joined
    assert ground.epoch == 0


def test_a_clock_that_was_set_back_begins_anew():
    ground = driven()
    ground.odometry(OdometrySample(2 * SECOND, np.zeros(3)))
    assert ground.epoch == 1
    assert len(ground.path) == 1
    assert not ground.fired


def test_how_near_readings_come_to_targets():
    assert driven().misses().distance_m < 1e-9
    assert driven(speed_m_s=3.0).misses().distance_m > 0.0  # 30 cm between two readings
    assert Ground(CONFIGURATION).misses().distance_m is None


def picture(t_ns, value=0, message=messages.compressed_image):
    pixels = np.full((8, 8, 3), value, np.uint8)
    made = message(t_ns, pixels)
    return Received("thymio/camera", made.__msgtype__, messages.encode(made), None)


def test_a_picture_is_found_by_its_time_and_passed_on_as_it_came():
    sights = Sights(CONFIGURATION)
    for t_ns in (1, 2, 3):
        sights.add(0, picture(t_ns, t_ns))
    [shot] = sights.at(2)
    assert (shot.t_ns, shot.media_type) == (2, "image/jpeg")
    assert sights.at(4) is None
    assert sights.newest()[0].t_ns == 3
    sights.add(0, Received("thymio/camera", "std_msgs/msg/Bool", b"", None))
    assert sights.unreadable == 1


def test_a_raw_picture_is_made_one_that_browsers_know():
    sights = Sights(CONFIGURATION)
    sights.add(0, picture(5, message=messages.image))
    [shot] = sights.newest()
    assert shot.file.startswith(b"\xff\xd8")


@pytest.mark.parametrize("message", [messages.compressed_image, messages.image])
def test_a_camera_that_hangs_is_noticed(message):
    """Whichever of them it is: by what it saw, since the stamps of what it sends go on."""
    sights = Sights(load("configs/pioneer.toml"))
    for t_ns in range(4):
        sights.add(1, picture(t_ns, message=message))
        sights.add(2, picture(t_ns, t_ns, message))
    assert sights.same == [0, 3, 0]
    sights.add(1, picture(9, 200, message))
    assert sights.same == [0, 0, 0]


def test_past_frames_keep_within_their_bytes_and_tell_what_changed():
    pasts, shot = Pasts(), Shot(0, b"x" * 4_000_000, "")
    for index in range(20):
        pasts.offer(index * 2 * SECOND, 2.0 * index, (shot,), np.zeros((1, 1), np.uint8))
    kept = list(pasts)
    assert len(kept) == 8
    assert pasts.oldest_key == kept[0].key == 13
    seen = pasts.revision
    labels = np.array([[1]], np.int8)
    pasts.tell(kept[3], labels, 7, closed=False)
    pasts.tell(kept[4], None, -1, closed=False)
    assert [past.key for past in pasts.since(seen)] == [kept[3].key]
    seen = pasts.revision
    pasts.tell(kept[3], labels, 7, closed=False)
    assert pasts.since(seen) == []
    pasts.tell(kept[3], None, 7, closed=True)
    assert pasts.since(seen)[0].labels is labels


@pytest.mark.parametrize(
    ("host", "origin", "allowed"),
    [
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("192.168.1.7:8080", "http://192.168.1.7:8080", True),
        ("[::1]:8080", "http://[::1]:8080", True),
        ("localhost:8080", "http://localhost:8080", True),
        ("localhost:8080", "http://localhost:9090", False),
        ("localhost:8080", "null", False),
        ("localhost:8080", None, False),
        ("rebound.example:8080", "http://rebound.example:8080", False),
        ("", "http://", False),
        ("[", "http://[", False),
    ],
)
def test_who_may_give_commands(host, origin, allowed):
    assert is_allowed(host, origin, wants_origin=True) is allowed
