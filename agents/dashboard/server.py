"""The web server: the page, a WebSocket that feeds it, and the few commands it may give.

A browser says when it is ready for more, so that a slow one gets less and a dead one nothing; there is no queue.
"""

import asyncio
import json
import logging
import socket
import threading
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from agents.dashboard.button import StopButton
from agents.dashboard.collector import Collector
from agents.dashboard.feed import Cursor, explained, hello, update
from agents.dashboard.guard import Guard
from agents.messages import MessageError
from agents.transport import RequestError

_LOG = logging.getLogger(__name__)
_CLOSE_S = 5.0
_PAGE = Path(__file__).parent / "page"
#: Requests to the learner that the page may make, with the arguments of each. It names no paths: those are this side's.
_COMMANDS: dict[str, dict[str, type]] = {"pause": {}, "resume": {}, "save": {}, "roll_back": {"version": int}}


class Dashboard:
    """Serves one robot's dashboard from a thread of its own; a context manager.

    Args:
        collector: what it shows.
        button: what the page's stop button presses.
        host: address to listen on.
        port: 0 takes a free one.
        save_to: folder, on the learner's machine, that checkpoints are saved in.
        per_s: updates a second.
    """

    def __init__(
        self, collector: Collector, button: StopButton, host: str, port: int, save_to: Path, per_s: float = 10.0
    ) -> None:
        self._collector, self._button = collector, button
        self._save_to, self._every_s = save_to, 1 / per_s
        self._watching = 0
        self._ticked = asyncio.Event()
        routes = [
            Route("/", self._index),
            Route("/past/{key:int}/{camera:int}", self._picture),
            Route("/explain/{key:int}", self._explain),
            Route("/stop", self._stop, methods=["POST"]),
            Route("/learner", self._command, methods=["POST"]),
            WebSocketRoute("/live", self._live),
            Mount("/page", StaticFiles(directory=_PAGE)),
        ]
        self._server = uvicorn.Server(
            uvicorn.Config(
                Guard(Starlette(routes=routes, lifespan=self._lifespan)),
                log_level="error",
                access_log=False,
                ws="websockets-sansio",
                ws_per_message_deflate=False,  # pictures are compressed already, and the rest is not worth the work
                timeout_graceful_shutdown=1,
            )
        )
        self._socket = _listen(host, port)
        self._thread = threading.Thread(target=self._serve, name="dashboard", daemon=True)
        self.failure: BaseException | None = None

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._socket.getsockname()[1])

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.should_exit = True
        self._thread.join(_CLOSE_S)
        self._socket.close()

    # --- in its thread

    def _serve(self) -> None:
        try:
            self._server.run([self._socket])
        except BaseException as error:  # a thread that dies silently looks like a page that only stands still
            _LOG.exception("the dashboard's server has failed")
            self.failure = error

    @asynccontextmanager
    async def _lifespan(self, _app: Starlette) -> AsyncGenerator[None]:
        task = asyncio.create_task(self._look())
        yield
        task.cancel()

    async def _look(self) -> None:
        """Look at the robot, and wake those who wait to tell a browser; for ever."""
        due_s = time.monotonic()
        while True:
            try:
                self._collector.tick()
            except Exception:
                _LOG.exception("a look at the robot has failed; going on")
            self._button.insist()
            ticked, self._ticked = self._ticked, asyncio.Event()
            ticked.set()
            due_s = max(due_s + self._every_s, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    async def _live(self, browser: WebSocket) -> None:
        """One browser: what is new, each time that it is ready for it."""
        await browser.accept()
        ready = asyncio.Event()
        self._watch(+1)
        try:
            await browser.send_text(json.dumps(hello(self._collector.configuration)))
            sender = asyncio.create_task(self._feed(browser, ready))
            try:
                while True:
                    await browser.receive_text()
                    ready.set()
            finally:
                sender.cancel()
        except (WebSocketDisconnect, RuntimeError):
            pass  # it has gone, while we listened or while we spoke
        finally:
            self._watch(-1)

    async def _feed(self, browser: WebSocket, ready: asyncio.Event) -> None:
        cursor = Cursor()
        while True:
            await ready.wait()
            await self._ticked.wait()
            ready.clear()
            await browser.send_bytes(update(self._collector, cursor))

    def _watch(self, change: int) -> None:
        self._watching += change
        watched = self._collector.questions.watched
        (watched.set if self._watching else watched.clear)()

    # --- requests

    async def _index(self, _request: Request) -> Response:
        return FileResponse(_PAGE / "index.html")

    async def _picture(self, request: Request) -> Response:
        with self._collector.lock:
            past = self._collector.pasts.get(int(request.path_params["key"]))
        camera = int(request.path_params["camera"])
        if past is None or not 0 <= camera < len(past.shots):
            return Response(status_code=404)
        try:
            shot = past.shots[camera]
            return Response(shot.file, media_type=shot.media_type, headers={"cache-control": "max-age=600"})
        except MessageError:
            return Response(status_code=404)

    async def _explain(self, request: Request) -> Response:
        with self._collector.lock:
            past = self._collector.pasts.get(int(request.path_params["key"]))
        if past is None:
            return _refused(404, "this frame is no longer kept")
        try:
            found = await asyncio.to_thread(self._collector.questions.explain, past)
        except RequestError as error:
            return _refused(503, str(error))
        if found is None:
            return _refused(410, "its window has closed, and nobody asked before: llrp explain tells from a recording")
        return JSONResponse(explained(found, past))

    async def _stop(self, request: Request) -> Response:
        body = await _body(request)
        if type(body.get("stop")) is not bool:
            return _refused(400, f'expected {{"stop": true or false}}, got {body}')
        self._button.press(body["stop"])
        return JSONResponse({"stop": body["stop"]})

    async def _command(self, request: Request) -> Response:
        body = await _body(request)
        name = str(body.pop("command", ""))
        if name not in _COMMANDS or {key: type(value) for key, value in body.items()} != _COMMANDS[name]:
            return _refused(400, f"expected a command, one of {sorted(_COMMANDS)}, with its arguments")
        if name == "save":
            body["path"] = str(self._save_to / time.strftime("%Y-%m-%d-%H%M%S"))
        try:
            result = await asyncio.to_thread(self._collector.questions.ask, name, **body)
        except RequestError as error:
            return _refused(503, str(error))
        return JSONResponse({"command": name, "result": result})


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens; ValueError says why there is none."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    found = socket.socket(family)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((host, port))
    except OSError as error:
        found.close()
        raise ValueError(
            f"cannot listen on {host}, port {port}: {error.strerror}; give another --port (0: any that is free), or "
            "another --host"
        ) from error
    return found


async def _body(request: Request) -> dict[str, Any]:
    """The request's JSON object; empty if it is none."""
    try:
        body = await request.json()
    except ValueError:
        return {}
    return body if isinstance(body, dict) else {}


def _refused(code: int, why: str) -> Response:
    return JSONResponse({"error": why}, status_code=code)
