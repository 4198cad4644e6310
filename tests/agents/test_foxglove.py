"""The live view, looked at by a real WebSocket client that speaks Foxglove's protocol."""

import json
import struct
import threading
import time

import psutil
import pytest

from agents import messages
from agents.extras import install
from agents.transport import Received, Stream
from tests.agents.processes import Agents, quick_configuration, until

pytest.importorskip("foxglove", reason=install("foxglove"))
from websockets.sync.client import ClientConnection, connect

from agents.foxglove_sink import FoxgloveSink

pytestmark = pytest.mark.live

SCAN, TWIST = "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/Twist"
WAIT_S = 60.0


def scan(t_ns: int, beams: int = 5) -> bytes:
    return messages.encode(messages.laser_scan(t_ns, [1.0] * beams, (0.0, 0.0), (0.0, 4.0)))


def say(sink: FoxgloveSink, data: bytes, topic: str = "range", kind: str = SCAN) -> None:
    sink.take(Received(f"thymio/{topic}", kind, data, None))


class Client:
    """Subscribes to all that is advertised; `read` gives the topic and the bytes of the next message."""

    def __init__(self, port: int, waiting: int = 1) -> None:
        self._opening = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=["foxglove.sdk.v1"],
            max_queue=waiting,
            max_size=None,
            close_timeout=0.1,
        )
        self.channels = {}

    def __enter__(self):
        self.connection: ClientConnection = self._opening.__enter__()
        self.info = json.loads(self.connection.recv(WAIT_S))
        return self

    def __exit__(self, *error):
        self._opening.__exit__(*error)

    def subscribe(self, *names: str) -> None:
        while not set(names) <= {channel["topic"] for channel in self.channels.values()}:
            told = json.loads(self.connection.recv(WAIT_S))
            if told["op"] == "advertise":
                self.channels |= {channel["id"]: channel for channel in told["channels"]}
        wanted = [{"id": n, "channelId": n} for n, channel in self.channels.items() if channel["topic"] in names]
        self.connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def read(self) -> tuple[str, bytes]:
        while isinstance(data := self.connection.recv(WAIT_S), str):
            pass
        opcode, subscription, _ = struct.unpack_from("<BIQ", data)
        assert opcode == 1
        return self.channels[subscription]["topic"], data[13:]

    def until(self, wanted: bytes) -> int:
        """Read on until these bytes; how many messages came before."""
        count = 0
        while self.read()[1] != wanted:
            count += 1
        return count


@pytest.fixture
def sink():
    made = FoxgloveSink("thymio", "127.0.0.1", port=0)
    yield made
    made.close()


def subscribed(sink: FoxgloveSink, client: Client, data: bytes) -> None:
    """Say it until the client has seen it: only then is its subscription in force."""
    stop = threading.Event()

    def repeat():
        while not stop.wait(0.01):
            say(sink, data)

    thread = threading.Thread(target=repeat)
    thread.start()
    client.until(data)
    stop.set()
    thread.join()


def test_the_bytes_come_as_they_are_with_the_definition_of_their_type(sink):
    say(sink, scan(0))
    with Client(sink.port) as client:
        assert (client.info["op"], client.info["name"]) == ("serverInfo", "thymio")
        client.subscribe("/thymio/range")
        subscribed(sink, client, scan(1))
        say(sink, scan(7))
        client.until(scan(7))
        [channel] = client.channels.values()
        assert channel["schemaName"] == SCAN
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schema"] == messages.definition(SCAN)


def test_a_client_can_do_nothing_but_look(sink):
    with Client(sink.port) as client:
        assert client.info["capabilities"] == []


def test_a_topic_that_comes_later_is_shown_too_and_what_is_no_ros_message_is_not(sink):
    with Client(sink.port) as client:
        say(sink, b"weights", "learner/weights", "")
        say(sink, scan(0))
        client.subscribe("/thymio/range")
        command = messages.encode(messages.twist(0.1, 0.0))
        say(sink, command, "cmd_vel", TWIST)
        client.subscribe("/thymio/cmd_vel")
        assert {channel["topic"] for channel in client.channels.values()} == {"/thymio/range", "/thymio/cmd_vel"}
    assert sink.sent == 2


def test_a_type_that_nobody_knows_is_counted(sink, caplog):
    for _ in range(2):
        say(sink, b"\0\1\0\0", "odd", "my_msgs/msg/Odd")
    assert sink.drops == {"odd": 2}
    assert sink.sent == 0
    assert caplog.text.count("cannot be shown") == 1


def test_a_client_that_reads_nothing_holds_up_nobody(sink):
    """Neither the sender, nor another client, nor the memory; and what it reads later is not old."""
    say(sink, scan(0))
    with Client(sink.port) as slow:
        slow.subscribe("/thymio/range")
        subscribed(sink, slow, scan(1))
        before = psutil.Process().memory_info().rss
        for number in range(3000):
            say(sink, scan(number, 25_000))  # 100 kB a message, 300 MB in all
        # What waits for it, in the server and in the sockets, is a few megabytes.
        assert psutil.Process().memory_info().rss - before < 60e6
        with Client(sink.port) as quick:
            quick.subscribe("/thymio/range")
            subscribed(sink, quick, scan(2))
        assert slow.until(scan(2)) < 1000


def test_a_port_that_is_taken_is_named(sink):
    with pytest.raises(RuntimeError, match=rf"127.0.0.1:{sink.port}: cannot listen there .*give another --port"):
        FoxgloveSink("thymio", "127.0.0.1", sink.port)


def test_as_an_agent_it_shows_what_a_robot_says_and_loses_none_of_it_to_a_slow_client(tmp_path):
    with Agents(tmp_path, quick_configuration(tmp_path)) as agents:
        agents.start("foxglove", "foxglove", "--port", "0")
        until(lambda: "ws://127.0.0.1:" in agents.said("foxglove"), "its address")
        port = int(agents.said("foxglove").rsplit(":", 1)[1])
        with Stream(agents.session, agents.key("range"), SCAN) as robot:
            time.sleep(0.3)
            robot.put(scan(0))
            with Client(port) as slow, Client(port, waiting=600) as quick:
                slow.subscribe("/thymio/range")
                quick.subscribe("/thymio/range")
                time.sleep(0.3)
                for number in range(1, 501):
                    robot.put(scan(number, 2500))
                quick.until(scan(500, 2500))
        agents.end("foxglove")
        assert agents.said("foxglove").splitlines()[-1] == "501 messages; never came: 0"
