"""Aseba messages to and from whatever a Thymio hangs on: a USB cable, its radio dongle, or TCP.

The messages are `thymiodirect`'s; the line is pyserial's, which reads sockets too.
"""

import struct
import threading
import time
from collections.abc import Sequence

import serial
from serial.tools import list_ports
from thymiodirect.message import Message

from replay.closing import Closing

_TCP = "tcp/"
_USB_VENDOR = 0x0617
_USB_PRODUCTS = {0x000A: "Thymio", 0x000C: "Thymio radio dongle"}
_BAUD = 115200  # a USB serial port ignores it, a real one beside it may not
# How long one look at the line takes. Messages are at least so far apart, and each comes in one go.
_LOOK_S = 0.02
_SETTLE_S = 2.0
_HEADER = struct.Struct("<HHH")  # bytes that follow these, who says it, type
_LONGEST_BYTES = 1024  # of a message; more is noise read as a length
_HOST_NODE = 1  # how this end calls itself, as Aseba's own tools do


class LinkError(RuntimeError):
    """No talking to the Thymio; the message says why, and what to do."""


class Link(Closing):
    """A line to one Thymio, or to several behind one dongle.

    One thread may receive while others send.

    Args:
        port: such as /dev/ttyACM0 or tcp/HOST:PORT; empty: the first Thymio or dongle that is plugged in.
        silence_s: a line on which nothing comes for so long is dead.
    """

    def __init__(self, port: str, silence_s: float = 1.0) -> None:
        self.name = port or _plugged_in()
        self._silence_s = silence_s
        self._turn = threading.Lock()
        try:
            self._line = _open(self.name, silence_s)
        except (serial.SerialException, OSError, ValueError) as error:
            raise LinkError(_why_not_opened(self.name, error)) from error
        self._settle()

    def receive(self) -> Message:
        """The next message, as its fields say; LinkError if none comes in time."""
        length, source, kind = _HEADER.unpack(self._exactly(_HEADER.size))
        if length > _LONGEST_BYTES:
            raise LinkError(f"{self.name}: a message of {length} bytes, which no Thymio sends: the line is out of step")
        message = Message(kind, source, self._exactly(length))
        try:
            message.decode()
        except (IndexError, UnicodeDecodeError, ValueError) as error:
            raise LinkError(f"{self.name}: a message of type {kind:#06x} that cannot be read: {error}") from error
        return message

    def send(self, kind: int, words: Sequence[int]) -> None:
        """One message, whole; LinkError if it cannot be said."""
        data = Message(kind, _HOST_NODE, Message.uint16array_to_bytes(words)).serialize()
        try:
            with self._turn:
                self._line.write(data)
        except (serial.SerialException, OSError) as error:
            raise LinkError(f"{self.name}: lost while sending: {error}") from error

    def close(self) -> None:
        """Hang up; a second call does nothing."""
        self._line.close()

    def _settle(self) -> None:
        """Begin between two messages: a Thymio that is running speaks already, and the first may be half gone."""
        end_s = time.monotonic() + _SETTLE_S
        while self._look(1) and time.monotonic() < end_s:
            pass

    def _exactly(self, count: int) -> bytes:
        data, heard_s = bytearray(), time.monotonic()
        while len(data) < count:
            if part := self._look(count - len(data)):
                data += part
                heard_s = time.monotonic()
            elif time.monotonic() - heard_s > self._silence_s:
                raise LinkError(f"{self.name}: silent for {self._silence_s:g} s: is the Thymio on, and in reach?")
        return bytes(data)

    def _look(self, most: int) -> bytes:
        try:
            return self._line.read(most)
        except (serial.SerialException, OSError) as error:
            raise LinkError(f"{self.name}: lost: {error}") from error


def _open(name: str, patience_s: float) -> serial.SerialBase:
    if name.startswith(_TCP):
        return serial.serial_for_url(f"socket://{name.removeprefix(_TCP)}", timeout=_LOOK_S, write_timeout=patience_s)
    return serial.Serial(name, _BAUD, timeout=_LOOK_S, write_timeout=patience_s, exclusive=True)


def _plugged_in() -> str:
    ports = {found.device: _USB_PRODUCTS.get(found.pid) for found in list_ports.comports() if found.vid == _USB_VENDOR}
    named = sorted(device for device, product in ports.items() if product)
    if not named:
        raise LinkError(
            "no Thymio and no Thymio dongle on USB: plug one in and switch the robot on, or name the port "
            "(--port /dev/ttyACM0, or --port tcp/HOST:PORT)"
        )
    return named[0]


def _why_not_opened(name: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == 13 or "Permission denied" in str(error):
        return f"{name}: no right to open it: `sudo usermod -aG dialout $USER`, then log in again"
    if number == 2 or "No such file" in str(error):
        return f"{name}: not there: is the Thymio plugged in and on? `ls /dev/ttyACM*` shows the ports"
    if "exclusively lock" in str(error):
        return f"{name}: another program holds it: end Thymio Suite, Aseba Studio, or the other `llrp`"
    return f"{name}: cannot be opened: {error}"
