"""What runs on the Thymio itself, and talking to it: twenty reports a second, and wheels that stop by themselves.

The Thymio runs a small program of ours, assembled for the variables its firmware says it has. At each beat of the motor
controller, a hundred a second, it adds up the wheels' speeds; so odometry misses nothing between two reports, and a
lost report loses nothing. The same beat counts down the life of the newest command, and stops the wheels when it is
over: whatever happens at this end, to the cable or to the computer, the robot stands within that time.
"""

import math
import secrets
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from thymiodirect.assembler import Assembler
from thymiodirect.connection import RemoteNode
from thymiodirect.message import Message

from agents.robots.thymio.link import Link, LinkError

BEAT_S = 0.01  # of the firmware's motor controller
BEATS_PER_REPORT = 5
SENSORS = 5
LARGEST_TARGET = 500  # beyond it the firmware drives no faster
_LONGEST_LIFE_BEATS = 0x7FFF

_REPORT_EVENT = 0
_LARGEST_MARK = 0x7FFF
_REPORT_WORDS = 5 + SENSORS
_CHUNK_WORDS = 256  # of a program, in one message
_GATHER_S = 1.0
_DESCRIBE_S = 5.0
_NEEDED = ("motor.left.target", "motor.right.target", "motor.left.speed", "motor.right.speed", "prox.horizontal")


def _lines(parts: Iterable[str]) -> str:
    return "\n    ".join(line.strip() for part in parts for line in part.split(";"))


def _zero(*names: str) -> str:
    return _lines(f"push.s 0; store {name}" for name in names)


def program(mark: int) -> str:
    """What the Thymio is to run, in Aseba's assembly; `mark` begins each of its reports.

    In the order of memory: the command, which this end writes in one message, then the report, which the robot sends.
    """
    return f"""
left:       equ _userdata
right:      equ _userdata+1
life:       equ _userdata+2
mark:       equ _userdata+3
beats:      equ _userdata+4
left_way:   equ _userdata+5
right_way:  equ _userdata+6
felt_beats: equ _userdata+7
felt:       equ _userdata+8

    dc end_toc
    dc _ev.init, init
    dc _ev.motor, motor
    dc _ev.prox, prox
end_toc:

init:
    push {mark}
    store mark
    {_zero("life", "beats", "left_way", "right_way", "felt_beats", "motor.left.target", "motor.right.target")}
    stop

prox:
    {_lines(f"load prox.horizontal+{n}; store felt+{n}" for n in range(SENSORS))}
    load beats
    store felt_beats
    stop

motor:
    load beats
    push.s 1
    add
    store beats
    load left_way
    load motor.left.speed
    add
    store left_way
    load right_way
    load motor.right.speed
    add
    store right_way

    load life
    push.s 0
    jump.if.not gt, dead
    load life
    push.s 1
    sub
    store life
    load left
    store motor.left.target
    load right
    store motor.right.target
    jump report
dead:
    {_zero("motor.left.target", "motor.right.target")}

report:
    load beats
    push.s {BEATS_PER_REPORT}
    mod
    push.s 0
    jump.if.not eq, done
    emit {_REPORT_EVENT}, mark, {_REPORT_WORDS}
done:
    stop
"""


@dataclass(frozen=True)
class Report:
    """What the Thymio says of itself, in its own units. All numbers but `proximity` wrap around at 16 bits.

    Attributes:
        beats: of the motor controller, BEAT_S each.
        left: sum of the left wheel's speed over the beats.
        right: of the right wheel's.
        felt_beats: the beat at which the proximity sensors were read.
        proximity: left to right; 0 where nothing is felt, thousands where something is close.
    """

    beats: int
    left: int
    right: int
    felt_beats: int
    proximity: tuple[int, ...]


class Firmware:
    """The Thymio at the other end of a link, with our program running on it. LinkError if there is none.

    One thread may wait for reports while others command.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._turn, self._halted = threading.Lock(), False
        # So that neither another program's event nor a report of the run before is taken for one of this run.
        self._mark = secrets.randbelow(_LARGEST_MARK) + 1
        self._id = _find(link)
        self._node = _describe(link, self._id)
        self._load()

    def report(self) -> Report:
        """The next one; LinkError if none comes in time."""
        waited_from_s = time.monotonic()
        while time.monotonic() - waited_from_s < _GATHER_S:
            if found := self._read(self._link.receive()):
                return found
        raise LinkError(
            f"{self._link.name}: the Thymio speaks, but our program on it does not: another program was loaded; "
            "end Thymio Suite or Aseba Studio"
        )

    def drive(self, left: int, right: int, life_s: float) -> None:
        """Turn the wheels at these targets, and stop after `life_s` if nothing newer comes; nothing after `halt`."""
        with self._turn:
            if not self._halted:
                self._command(left, right, min(max(round(life_s / BEAT_S), 0), _LONGEST_LIFE_BEATS))

    def halt(self) -> None:
        """Stop the wheels for good, and see them stopped; LinkError if that cannot be seen.

        Who hangs up at once may take back what was said last: a socket closed with reports unread does.
        """
        with self._turn:
            self._halted = True
            self._command(0, 0, 0)
        before, end_s = self.report(), time.monotonic() + _GATHER_S
        while time.monotonic() < end_s:
            after = self.report()
            if (after.left, after.right) == (before.left, before.right):
                return
            before = after
        raise LinkError(f"{self._link.name}: the wheels go on turning though told to stop: switch the robot off")

    def _command(self, left: int, right: int, life: int) -> None:
        self._link.send(Message.ID_SET_VARIABLES, [self._id, self._node.var_total_size, left, right, life])

    def _read(self, message: Message) -> Report | None:
        if message.source_node != self._id or message.id != _REPORT_EVENT:
            return None
        words: Sequence[int] = message.user_event_arg
        if len(words) != _REPORT_WORDS or words[0] != self._mark:
            return None
        return Report(words[1], words[2], words[3], words[4], tuple(words[5:]))

    def _load(self) -> None:
        try:
            words = Assembler(self._node, program(self._mark)).assemble()
        except Exception as error:  # the assembler raises nothing more special
            raise LinkError(f"{self._link.name}: the program does not fit this Thymio's firmware: {error}") from error
        for start in range(0, len(words), _CHUNK_WORDS):
            chunk = words[start : start + _CHUNK_WORDS]
            self._link.send(Message.ID_SET_BYTECODE, [self._id, start, *chunk])
        self._link.send(Message.ID_RUN, [self._id])


def _find(link: Link) -> int:
    """The node of the one Thymio that answers."""
    link.send(Message.ID_LIST_NODES, [Message.PROTOCOL_VERSION])
    nodes: set[int] = set()
    end_s = time.monotonic() + _GATHER_S
    while time.monotonic() < end_s:
        try:
            message = link.receive()
        except LinkError:
            if nodes:
                break
            raise
        if message.id == Message.ID_NODE_PRESENT:
            nodes.add(message.source_node)
    if len(nodes) == 1:
        return nodes.pop()
    if nodes:
        raise LinkError(f"{link.name}: {len(nodes)} robots answer there, expected one: switch the others off")
    raise LinkError(f"{link.name}: something speaks there, but no Thymio answers: wrong port, or an old firmware")


def _describe(link: Link, node_id: int) -> RemoteNode:
    """The variables and events of a node."""
    node = RemoteNode(node_id)
    link.send(Message.ID_GET_NODE_DESCRIPTION, [node_id, Message.PROTOCOL_VERSION])
    end_s = time.monotonic() + _DESCRIBE_S
    variables = events = math.inf
    while time.monotonic() < end_s:
        message = link.receive()
        if message.source_node != node_id:
            continue
        if message.id == Message.ID_DESCRIPTION:
            node.name, variables, events = message.node_name, message.num_named_var, message.num_local_events
        elif message.id == Message.ID_NAMED_VARIABLE_DESCRIPTION:
            node.add_var(message.var_name, message.var_size)
        elif message.id == Message.ID_LOCAL_EVENT_DESCRIPTION:
            node.local_events.append(message.event_name)
        if len(node.local_events) >= events:  # these come last but for the functions
            return _checked(link, node, variables)
    raise LinkError(f"{link.name}: the robot did not finish describing itself within {_DESCRIBE_S:g} s: a bad line?")


def _checked(link: Link, node: RemoteNode, variables: float) -> RemoteNode:
    missing = [name for name in _NEEDED if name not in node.var_offset]
    if missing or len(node.named_variables) != variables:
        lost = f"no {missing[0]}" if missing else f"{len(node.named_variables)} of {variables:g} variables"
        raise LinkError(f"{link.name}: {node.name!r} answers, but has {lost}; expected a Thymio II")
    return node
