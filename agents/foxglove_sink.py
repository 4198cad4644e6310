"""A robot's topics, live, to Foxglove: the bytes as they are, with ROS 2's own definitions beside them.

The server is foxglove-sdk's, a thread of its own outside the interpreter. Each client has a short queue; when it is
full the oldest message goes. So neither a slow client nor a dead one is ever waited for, and what it is shown is not
old. Clients may look and nothing else: the server takes no messages, no parameters and no calls from them.
"""

import importlib
import logging
from collections import Counter
from typing import Any

from agents import messages
from agents.extras import install
from agents.messages import MessageError
from agents.transport import Received, topic

_LOG = logging.getLogger(__name__)
#: Messages that wait for a client: about a second of a robot's topics.
_BACKLOG = 64


class FoxgloveSink:
    """Hands on what it is given; `take` is for one thread.

    Args:
        robot: its name, and the server's.
        host: where to listen; anyone who reaches it sees what the robot sees.
        port: 0: any that is free.

    Attributes:
        port: where it listens.
        sent: messages handed to the server, whether or not anyone looks.
        drops: what could not be handed on, by topic.

    >>> sink = FoxgloveSink("thymio", "127.0.0.1", port=0)
    >>> scan = messages.laser_scan(5, [1.0], (0.0, 0.0), (0.0, 4.0))
    >>> sink.take(Received("thymio/range", "sensor_msgs/msg/LaserScan", messages.encode(scan), None))
    >>> sink.close()
    >>> sink.sent, dict(sink.drops)
    (1, {})
    """

    def __init__(self, robot: str, host: str, port: int) -> None:
        self.sent = 0
        self.drops: Counter[str] = Counter()
        self._robot = robot
        self._foxglove = _library()
        self._context = self._foxglove.Context()
        self._channels: dict[tuple[str, str], Any] = {}
        try:
            self._server = self._foxglove.start_server(
                name=robot, host=host, port=port, capabilities=[], context=self._context, message_backlog_size=_BACKLOG
            )
        except RuntimeError as error:
            reason = str(error).removeprefix("FoxgloveError: ")
            raise RuntimeError(
                f"{host}:{port}: cannot listen there ({reason}); give another --port or --host"
            ) from error
        self.port = int(self._server.port)

    def take(self, message: Received) -> None:
        """Hand on a message; one that is no ROS message, such as weights, is passed over."""
        if not message.type:
            return
        name = topic(self._robot, message.key)
        try:
            self._channel(name, message.type).log(message.data)
        except MessageError as error:  # a type without a definition
            if not self.drops[name]:
                _LOG.warning("%s: cannot be shown: %s", name, error)
            self.drops[name] += 1
            return
        self.sent += 1

    def close(self) -> None:
        """Let go of all clients."""
        self._server.stop()
        for channel in self._channels.values():
            channel.close()

    def _channel(self, name: str, type_name: str) -> Any:
        found = self._channels.get((name, type_name))
        if found is None:
            definition = messages.definition(type_name).encode()
            schema = self._foxglove.Schema(name=type_name, encoding="ros2msg", data=definition)
            found = self._foxglove.Channel(
                f"/{self._robot}/{name}", schema=schema, message_encoding="cdr", context=self._context
            )
            self._channels[name, type_name] = found
        return found


def _library() -> Any:
    try:
        return importlib.import_module("foxglove")
    except ImportError as error:
        raise RuntimeError(f"a live view in Foxglove needs foxglove-sdk: {install('foxglove')}") from error
