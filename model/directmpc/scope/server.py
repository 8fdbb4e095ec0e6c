"""The scope's server: the page, the rows as they come, orders of the page, exports, other hosts.

Rows go out in binary frames of a websocket, about 30 a second. Orders and their answers are JSON.

It listens on the loopback address unless told otherwise, and then with a token. A request has to
name this server as its host, and a browser has to come from its own page: a page of another origin
can neither give orders nor read. The page that has started the drive holds it: when it closes, or
does not answer for a few seconds, the drive is turned off.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import secrets
import socket
import struct
from collections.abc import Awaitable, Callable, Mapping
from http.cookies import SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import numpy as np
import uvicorn
from platformdirs import user_config_path
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from directmpc.host.gate_guard import FAULTS
from directmpc.output_files import replacing
from directmpc.scope import record as records
from directmpc.scope.live import Live, OrderError
from directmpc.scope.record import Record

STATIC = Path(__file__).resolve().parent / "static"
PERIOD = 1 / 30
"""Between two frames, s."""

ROWS, EDGES = 1, 2
"""First word of a binary frame."""

_MOST_ROWS = 8_000
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_COOKIE = "directmpc_scope"
_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
    "frame-ancestors 'none'"
)

Scope = dict[str, Any]
App = Callable[[Scope, Any, Any], Awaitable[None]]


class Doorkeeper:
    """Lets in who may come in: right host, own origin, and the token where there is one.

    The token is in the query or the cookie; None on the loopback address.
    """

    def __init__(self, app: App, token: str | None) -> None:
        self._app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        """Serve a connection, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        if why := self._refusal(scope, headers):
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 4403, "reason": why})
            else:
                await PlainTextResponse(f"scope: {why}\n", 403)(scope, receive, send)
            return

        async def sent(message: Any) -> None:
            """Add what every answer has."""
            if message["type"] == "http.response.start":
                own = [
                    (b"content-security-policy", _POLICY.encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"cache-control", b"no-store"),
                    (b"referrer-policy", b"no-referrer"),
                ]
                if self.token:
                    cookie = f"{_COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
                    own.append((b"set-cookie", cookie.encode()))
                message["headers"] = [*message["headers"], *own]
            await send(message)

        await self._app(scope, receive, sent)

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> str:
        """Why a connection is refused; empty where it is not."""
        host = headers.get("host", "")
        name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
        if self.token is None and name not in _LOOPBACK:
            return f"the host {host!r:.60} is not this computer"
        origin = headers.get("origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return f"pages of {origin!r:.60} may not use it"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "pages of another site may not use it"
        if self.token:
            asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
            jar = SimpleCookie(headers.get("cookie", ""))
            kept = jar[_COOKIE].value if _COOKIE in jar else ""
            if not any(hmac.compare_digest(x.encode(), self.token.encode()) for x in (asked, kept)):
                return "the token is missing or wrong"
        return ""


class Presets:
    """Named settings of the page, in the user's folder of settings."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or user_config_path("directmpc") / "scope.json"

    def all(self) -> dict[str, Any]:
        """Every preset by name; empty where there is no file that can be read."""
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}

    def keep(self, name: str, value: Any) -> dict[str, Any]:
        """Keep a preset (JSON), or forget it with None; gives all of them."""
        found = self.all() | {name: value}
        found = {k: v for k, v in found.items() if v is not None}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(self.path) as temporary:
            temporary.write_text(json.dumps(found), encoding="utf-8")
        return found


class Server:
    """Pages of one record. `live` fills it and takes orders; None for a run that is over."""

    def __init__(
        self,
        record: Record,
        live: Live | None,
        title: str,
        token: str | None = None,
        presets: Presets | None = None,
    ) -> None:
        self.record, self.live, self.title = record, live, title
        self.presets = presets or Presets()
        self._holder: WebSocket | None = None
        routes = [
            Route("/", self._page),
            Route("/export/{kind}", self._export),
            Route("/link", self._link, methods=["POST"]),
            WebSocketRoute("/ws", self._socket),
            Mount("/static", StaticFiles(directory=STATIC)),
        ]
        self.app = Doorkeeper(Starlette(routes=routes), token)

    async def _page(self, _: Request) -> Response:
        return Response((STATIC / "index.html").read_bytes(), media_type="text/html")

    async def _export(self, request: Request) -> Response:
        asked = request.query_params
        record, _ = self._chosen(asked)
        try:
            if record is None:
                raise ValueError("there is no such recording; the oldest are no longer kept")
            first, last, unit = (
                int(asked.get(n, d)) for n, d in (("first", 0), ("last", 2**62), ("unit", 0))
            )
            name, data = await run_in_threadpool(
                records.written,
                record,
                request.path_params["kind"],
                first,
                last,
                int(bool(unit)),
            )
        except KeyError:
            return PlainTextResponse("scope: csv, trace, decisions and fst can be exported\n", 404)
        except ValueError as error:
            return PlainTextResponse(f"scope: {error}\n", 400)
        found = {"content-disposition": f'attachment; filename="{name}"'}
        return Response(data, media_type="application/octet-stream", headers=found)

    async def _link(self, request: Request) -> Response:
        """A request of another host: kind, whether it is sent once, payload."""
        if self.live is None:
            return PlainTextResponse("scope: no board is behind it\n", 409)
        body = await request.body()
        if len(body) < 2:
            return PlainTextResponse("scope: no request of a link\n", 400)
        done = asyncio.wrap_future(self.live.joined(body[0], bool(body[1]), body[2:]))
        try:
            return Response(await done, media_type="application/octet-stream")
        except OrderError as error:
            return JSONResponse(error.told, 409)

    def _chosen(self, params: Mapping[str, str]) -> tuple[Record | None, Live | None]:
        """The record that a request is about: the run, or a recording of its board."""
        if not (number := params.get("recording")):
            return self.record, self.live
        kept = self.live.recordings if self.live else {}
        return kept.get(int(number)) if number.isascii() and number.isdigit() else None, None

    def _hello(self, record: Record, live: Live | None) -> dict[str, Any]:
        return {
            "hello": {
                "title": self.title,
                "controller": record.drive.controller,
                "ts": record.ts,
                "channels": record.signals.described(),
                "gates": 24 if record.signals.five else 6,
                "faults": FAULTS,
                "live": live is not None,
                "recorder": live is not None and live.recorder,
                "settings": [s.described() for s in live.settings] if live else [],
                "presets": self.presets.all(),
            }
        }

    async def _socket(self, socket_: WebSocket) -> None:
        """One page: rows out, orders in, each as it comes."""
        record, live = self._chosen(socket_.query_params)
        await socket_.accept()
        if record is None:
            await socket_.close(reason="there is no such recording; the oldest are no longer kept")
            return
        await socket_.send_json(self._hello(record, live))
        sending = asyncio.create_task(self._send(socket_, record, live))
        try:
            while True:
                order = json.loads(await socket_.receive_text())
                await socket_.send_json(await self._ordered(socket_, order))
        except (WebSocketDisconnect, ValueError, RuntimeError):
            pass
        finally:
            sending.cancel()
            if self._holder is socket_ and self.live is not None:
                self._holder = None
                self.live.give("stop")

    async def _ordered(self, socket_: WebSocket, order: Any) -> dict[str, Any]:
        """Carry out an order of a page, and answer it."""
        number = order.get("number") if isinstance(order, dict) else None
        try:
            if not isinstance(order, dict) or not isinstance(order.get("do"), str):
                raise OrderError("an order has a name, do")
            name = order["do"]
            if name == "preset":
                found = await run_in_threadpool(
                    self.presets.keep, str(order.get("name", ""))[:80], order.get("value")
                )
                return {"number": number, "presets": found}
            if self.live is None:
                raise OrderError("this run is over; nothing can be ordered")
            if name == "start":
                self._holder = socket_
            done = self.live.give(name, order.get("values"))
            await asyncio.wrap_future(done)
        except OrderError as error:
            return {"number": number, "error": str(error)}
        except OSError as error:
            return {"number": number, "error": f"{error.filename}: {error.strerror}"}
        return {"number": number, "settings": [s.described() for s in self.live.settings]}

    async def _send(self, socket_: WebSocket, record: Record, live: Live | None) -> None:
        """Rows, edges and the state, as they change."""
        row, edge, before = record.first, 0, None
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                row = max(row, record.first)
                if (last := min(record.total, row + _MOST_ROWS)) > row:
                    values = await run_in_threadpool(
                        lambda a=row, b=last: record.signals.values(record.table(a, b))
                    )
                    count = values.shape[1]
                    head = struct.pack("<IIII", ROWS, last - count, count, len(values))
                    await socket_.send_bytes(head + values.tobytes())
                    row = last
                if record.edge_total > edge:
                    edge = max(edge, record.first_edge)
                    found = record.edges_from(edge)[:_MOST_ROWS]
                    edge += len(found)
                    times = np.array([time for time, _ in found])
                    words = np.array([word for _, word in found], np.uint32)
                    head = struct.pack("<IIII", EDGES, 0, len(found), 0)
                    await socket_.send_bytes(head + times.tobytes() + words.tobytes())
                state = {"rows": record.total, "events": record.events}
                state |= live.state() if live else {}
                if state != before:
                    await socket_.send_json({"state": state})
                    before = state
                behind = record.total > row or record.edge_total > edge
                await asyncio.sleep(0 if behind and not live else PERIOD)


def serving(server: Server, host: str, port: int) -> tuple[uvicorn.Server, socket.socket]:
    """A server that can be run, and the open socket that it listens on; port 0: any free one.

    OSError if the address is taken, or none of this computer.
    """
    listening = socket.create_server((host, port))
    config = uvicorn.Config(
        server.app, log_level="error", access_log=False, lifespan="off", ws="websockets-sansio",
        ws_ping_interval=1.0, ws_ping_timeout=3.0, timeout_graceful_shutdown=1,
    )  # fmt: skip
    return uvicorn.Server(config), listening


def new_token() -> str:
    """A token that nobody can guess."""
    return secrets.token_urlsafe(18)
