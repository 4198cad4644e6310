"""One Zenoh session a process: peers on loopback that find each other through one endpoint."""

import json
import re
import socket
from collections.abc import Sequence

import zenoh

from agents.transport.naming import Naming, Plain, Ros2Zenoh
from agents.transport.ros_graph import Qos, RosGraph
from replay.closing import Closing

# Everybody listens somewhere: agents link directly, and a hub that goes takes no link of the others with it.
_ANY_LOOPBACK_PORT = ("tcp/127.0.0.1:0",)
# Messages of one kind that may wait for a link: with Zenoh's own two, the third that is put while its thread waits for
# the processor is dropped, such as predictions after a stall.
_BURST = 8
_CHUNK = re.compile(r"[^/*$?#@ ][^/*$?# ]*")


class TransportError(RuntimeError):
    """Agents cannot meet; the message says where they tried."""


class Session(Closing):
    """A Zenoh session, and what topics are called on it. Made by `open_session`.

    Attributes:
        zenoh: the session itself.
        naming: the dialect spoken on it.
    """

    def __init__(self, session: zenoh.Session, naming: Naming, name: str) -> None:
        self.zenoh, self.naming = session, naming
        self._graph = RosGraph(session, naming, f"llrp_{name}") if isinstance(naming, Ros2Zenoh) and name else None

    def publishes(self, key: str, type_name: str, qos: Qos) -> zenoh.LivelinessToken | None:
        """Tell ROS 2 so, where it can hear it; the token is to be undeclared."""
        return self._graph.publisher(key, type_name, qos) if self._graph is not None and type_name else None

    def subscribes(self, key: str, type_name: str, qos: Qos) -> zenoh.LivelinessToken | None:
        """Tell ROS 2 so, where it can hear it; the token is to be undeclared."""
        return self._graph.subscription(key, type_name, qos) if self._graph is not None and type_name else None

    def close(self) -> None:
        """Ends every subscription and publisher, too."""
        self.zenoh.close()


def open_session(
    endpoint: str,
    hub: bool | None = None,
    name: str = "",
    listen: Sequence[str] = _ANY_LOOPBACK_PORT,
    lease_ms: int = 2000,
    naming: Naming | None = None,
) -> Session:
    """A session of all agents that name the same endpoint, such as "tcp/127.0.0.1:7447".

    Args:
        endpoint: where agents meet. Whoever finds it free listens there, the others connect; once met, all have direct
            links, so that the hub may go and come back.
        hub: None: as it comes. True: listen, or TransportError. False: connect, now or as soon as somebody listens.
        name: of the agent, for Zenoh's own tools and for ROS 2's.
        listen: where else to listen; more than loopback opens the robot to the network, without authentication.
        lease_ms: others take this session for gone after such a silence.
        naming: what topics are called; None: plain.

    Close it with `with` or `close`; that ends every subscription.
    """
    zenoh.init_log_from_env_or("off")  # what matters comes as an exception; the rest would clutter the terminal
    reasons: list[str] = []
    for hubs in [True, False] if hub is None else [hub]:
        endpoints = ([endpoint, *listen], []) if hubs else (list(listen), [endpoint])
        try:
            return Session(zenoh.open(_configuration(*endpoints, name, lease_ms)), naming or Plain(), name)
        except zenoh.ZError as error:
            reasons.append(f"{'listen' if hubs else 'connect'}: {str(error).split(' at /')[0]}")
    raise TransportError(f"{endpoint}: cannot meet there; expected such as tcp/127.0.0.1:7447; {'; '.join(reasons)}")


def free_endpoint() -> str:
    """An endpoint on loopback that nobody else uses: for agents that only one program starts."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def key(robot: str, topic: str) -> str:
    """A robot's topic as a key; a leading slash does not matter.

    >>> key("thymio", "/learner/status")
    'thymio/learner/status'
    """
    joined = f"{robot}/{topic.removeprefix('/')}"
    if not all(_CHUNK.fullmatch(chunk) for chunk in joined.split("/")):
        raise TransportError(f"{joined!r}: expected names joined by single slashes, without spaces or any of * $ ? #")
    return joined


def topic(robot: str, key: str) -> str:
    """The other way.

    >>> topic("thymio", "thymio/learner/status")
    'learner/status'
    """
    return key.removeprefix(f"{robot}/")


def _configuration(listen: list[str], connect: list[str], name: str, lease_ms: int) -> zenoh.Config:
    configuration = zenoh.Config()
    for path, value in {
        "mode": "peer",
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,  # agents of another project on the same machine are not to be found
        "scouting/gossip/enabled": True,
        "scouting/delay": 100,  # how long opening waits for links to those whom the hub names; they come anyway [ms]
        "transport/link/tx/lease": lease_ms,
        "transport/link/tx/queue/size/data": _BURST,
        "transport/shared_memory/enabled": False,
        "timestamping/enabled": True,  # what recovery of lost messages rests on
        "metadata": {"name": name},
    }.items():
        configuration.insert_json5(path, json.dumps(value))
    return configuration
