"""The makers' simulator, asebaplayground: the Thymio's own virtual machine and protocol, on a screen that nobody sees.

It says over D-Bus where the robot truly is, and can put it elsewhere.
"""

import contextlib
import os
import select
import shutil
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from jeepney import DBusAddress, MessageType, Properties, new_method_call
from jeepney.io.blocking import open_dbus_connection

SCENES = Path(__file__).parent / "playgrounds"
PROGRAMS = ("asebaplayground", "Xvfb", "dbus-daemon")
#: The simulated robot's own figures, from its source: 16.6 cm/s at 500, wheels 9.4 cm apart.
SPEED_UNIT_M_S = 0.166 / 500
TRACK_M = 0.094
_BUS = "ch.epfl.mobots.AsebaPlayground"
_WORLD = DBusAddress("/world", _BUS, "ch.epfl.mobots.EnkiWorld")
_WAIT_S = 60.0

missing = [name for name in PROGRAMS if shutil.which(name) is None]
needs_playground = pytest.mark.skipif(
    bool(missing),
    reason=f"no {', '.join(missing)}: apt-get install --no-install-recommends aseba xvfb dbus-daemon",
)


class Relay:
    """Keeps one connection to the simulator, whoever comes and goes at this end: it may crash when a client leaves.

    Attributes:
        port: where to come.
    """

    def __init__(self, simulator: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self._simulator = socket.create_connection(("127.0.0.1", simulator))
        self._client: socket.socket | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._take(None)
        self._simulator.close()
        self._listener.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            waiting = [part for part in (self._listener, self._simulator, self._client) if part is not None]
            for ready in select.select(waiting, [], [], 0.02)[0]:
                if ready is self._listener:
                    self._take(self._listener.accept()[0])
                elif ready is self._simulator:
                    self._carry(self._simulator, self._client)
                elif ready is self._client:
                    self._carry(self._client, self._simulator)

    def _take(self, client: socket.socket | None) -> None:
        if self._client is not None:
            self._client.close()
        self._client = client

    def _carry(self, one: socket.socket, other: socket.socket | None) -> None:
        try:
            data = one.recv(4096)
            if other is not None:
                other.sendall(data)
            if not data:
                raise ConnectionResetError
        except OSError:
            if one is self._simulator and other is None:
                self._stop.set()  # the simulator is gone
            self._take(None)


class Playground:
    """One scene with one Thymio; ends with the block.

    Attributes:
        port: for `llrp robot --port`.
    """

    def __init__(self, folder: Path, scene: str) -> None:
        self._stack = contextlib.ExitStack()
        self._folder = folder
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._tcp = probe.getsockname()[1]
        self.port = ""
        self._scene = folder / f"{scene}.playground"
        text = (SCENES / f"{scene}.playground").read_text()
        assert 'port="33333"' in text
        self._scene.write_text(text.replace('port="33333"', f'port="{self._tcp}"'))

    def __enter__(self) -> "Playground":
        with contextlib.ExitStack() as stack:
            self._start(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def pose(self) -> np.ndarray:
        """(3,) float64 [x_m, y_m, yaw_rad] in the scene: the truth."""
        [found] = self._ask(Properties(self._robot).get_all())
        return np.array([found["x"][1] / 100, found["y"][1] / 100, found["angle"][1]])

    def put(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """The robot, there."""
        for name, value in (("x", 100 * x_m), ("y", 100 * y_m), ("angle", yaw_rad)):
            self._ask(Properties(self._robot).set(name, "d", float(value)))

    @contextlib.contextmanager
    def frozen(self):
        """Nothing goes on in it, and nothing is said, until the block ends."""
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def _start(self, stack: contextlib.ExitStack) -> None:
        env = {
            **os.environ,
            "HOME": str(self._folder),
            "XDG_RUNTIME_DIR": str(self._folder),
            "LIBGL_ALWAYS_SOFTWARE": "1",
        }
        env |= {"LANG": "C", "DISPLAY": f":{self._first_line(stack, env, 'Xvfb', *_XVFB)}"}
        env["DBUS_SESSION_BUS_ADDRESS"] = self._first_line(
            stack, env, "dbus-daemon", "--session", "--nofork", "--print-address=1"
        )
        with (self._folder / "playground.log").open("wb") as log:
            words = ["asebaplayground", str(self._scene)]
            self._process = _ended(stack, subprocess.Popen(words, env=env, stdout=log, stderr=log))
        self._connection = stack.enter_context(open_dbus_connection(bus=env["DBUS_SESSION_BUS_ADDRESS"]))
        end_s = time.monotonic() + _WAIT_S
        while True:
            try:
                [[name]] = self._ask(new_method_call(_WORLD, "PhysicalObjectsByType", "s", ("Thymio",)))
                break
            except AssertionError:
                assert self._process.poll() is None, (self._folder / "playground.log").read_text()
                assert time.monotonic() < end_s, (self._folder / "playground.log").read_text()
                time.sleep(0.1)
        relay = Relay(self._tcp)
        stack.callback(relay.close)
        self.port = relay.port
        [path] = self._ask(new_method_call(_WORLD, "PhysicalObject", "s", (name,)))
        self._robot = DBusAddress(path, _BUS, "ch.epfl.mobots.EnkiPhysicalObject")

    def _first_line(self, stack: contextlib.ExitStack, env: dict[str, str], *words: str) -> str:
        with (self._folder / f"{words[0]}.log").open("wb") as log:
            process = _ended(stack, subprocess.Popen(words, env=env, stdout=subprocess.PIPE, stderr=log, text=True))
        stack.enter_context(process.stdout)
        line = process.stdout.readline().strip()
        assert line, (self._folder / f"{words[0]}.log").read_text()
        return line

    def _ask(self, call: object) -> tuple:
        reply = self._connection.send_and_get_reply(call, timeout=_WAIT_S)
        assert reply.header.message_type is MessageType.method_return, reply.body
        return reply.body


_XVFB = ("-displayfd", "1", "-screen", "0", "320x240x24", "-nolisten", "tcp")


def _ended(stack: contextlib.ExitStack, process: subprocess.Popen) -> subprocess.Popen:
    def end() -> None:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    stack.callback(end)
    return process
