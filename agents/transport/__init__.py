"""How agents meet and talk: Zenoh, on loopback unless told otherwise, every key under a robot's name.

Three kinds of topic, each with the publisher and the subscriber that fit it:

- `Frames` and `subscribe_latest`: only the newest counts (pictures, predictions). A slow reader skips some.
- `Stream` and `subscribe_stream`: every message counts, in order (odometry, readings). What the network drops is asked
  for again; what stays lost is counted.
- `State` and `subscribe_state`: the last value counts, also for those who join later (weights, status).

What a topic is called on the wire is the session's business (`naming`): the plain key, or what ROS 2 calls it. Whoever
only looks on, at a pace of its own, takes from `Polled`.

One publisher a key. Each message carries its ROS type in its encoding, `application/cdr;sensor_msgs/msg/Image`, so that
a recorder needs no table of topics; a payload that is no ROS message has no type.

Every handler runs in a thread of its own subscription, reading from a channel: a callback of Zenoh's own hides a queue
that makes frames seconds old, and one left open hangs the process at its end.
"""

from agents.transport.naming import Naming, Plain, Ros2Dds, Ros2Zenoh, RosNames, Sent
from agents.transport.presence import announce, present, watch, watch_elder
from agents.transport.publish import Frames, Publisher, State, Stream
from agents.transport.requests import NoAnswer, Refused, RequestError, call, serve
from agents.transport.samples import Received
from agents.transport.session import Session, TransportError, free_endpoint, key, open_session, topic
from agents.transport.subscribe import (
    Polled,
    Subscription,
    subscribe_all,
    subscribe_latest,
    subscribe_state,
    subscribe_stream,
)

__all__ = [
    "Frames",
    "Naming",
    "NoAnswer",
    "Plain",
    "Polled",
    "Publisher",
    "Received",
    "Refused",
    "RequestError",
    "Ros2Dds",
    "Ros2Zenoh",
    "RosNames",
    "Sent",
    "Session",
    "State",
    "Stream",
    "Subscription",
    "TransportError",
    "announce",
    "call",
    "free_endpoint",
    "key",
    "open_session",
    "present",
    "serve",
    "subscribe_all",
    "subscribe_latest",
    "subscribe_state",
    "subscribe_stream",
    "topic",
    "watch",
    "watch_elder",
]
