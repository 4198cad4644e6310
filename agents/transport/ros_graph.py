"""Being seen by ROS 2: tokens that say which nodes there are and what they publish and subscribe to.

rmw_zenoh's nodes find each other by Zenoh's liveliness tokens below `@ros2_lv/`; `ros2 topic list` and `ros2 node list`
read them. Data flows without; they are for people and for tools.
"""

import itertools
from enum import Enum

import zenoh

from agents.transport.naming import Ros2Zenoh

_NOTHING = "%"  # stands for an empty part and for each slash


class Qos(Enum):
    """Quality of service, as rmw_zenoh writes it: what is its default is left out."""

    LATEST = "2::,1:,:,:,,"  # best effort, keep the last
    STREAM = "::,10:,:,:,,"  # reliable, keep the last ten
    STATE = ":1:,1:,:,:,,"  # reliable, transient local, keep the last


class RosGraph:
    """One session's node in the ROS 2 graph.

    Args:
        session: of Zenoh; its end takes the tokens with it.
        naming: gives domain, names and types.
        node: its name, such as `llrp_learner`.
    """

    def __init__(self, session: zenoh.Session, naming: Ros2Zenoh, node: str) -> None:
        self._session, self._naming, self._node = session, naming, node
        self._entities = itertools.count(1)
        self._before = f"@ros2_lv/{naming.domain}/{session.zid()}/0"
        self._token = self._declare(f"0/NN/{self._named}")

    def publisher(self, key: str, type_name: str, qos: Qos) -> zenoh.LivelinessToken:
        """Say that it publishes there."""
        return self._endpoint("MP", key, type_name, qos)

    def subscription(self, key: str, type_name: str, qos: Qos) -> zenoh.LivelinessToken:
        """Say that it subscribes there."""
        return self._endpoint("MS", key, type_name, qos)

    @property
    def _named(self) -> str:
        """Enclave, namespace and name of the node."""
        return f"{_NOTHING}/{_NOTHING}/{self._node}"

    def _endpoint(self, kind: str, key: str, type_name: str, qos: Qos) -> zenoh.LivelinessToken:
        topic = f"/{self._naming.names.name(key)}".replace("/", _NOTHING)
        typed = self._naming.typed(type_name)
        return self._declare(f"{next(self._entities)}/{kind}/{self._named}/{topic}/{typed}/{qos.value}")

    def _declare(self, entity: str) -> zenoh.LivelinessToken:
        return self._session.liveliness().declare_token(f"{self._before}/{entity}")
