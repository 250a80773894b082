"""`bywire.serve`: the server from its start to Ctrl-C, and its connections."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl, quote, unquote, urlsplit

from bywire.core.arguments import checked
from bywire.core.callers import is_command_line
from bywire.core.clean_text import shortened
from bywire.core.errors import (
    BywireError,
    FileError,
    ParameterError,
    not_valid,
    quoted,
    unknown_name,
)
from bywire.core.version import __version__
from bywire.server import guard
from bywire.server.address import HERE, PORT
from bywire.server.exchange import REFUSAL, RefusedError, Reply, Request
from bywire.server.field import is_file_name
from bywire.server.live_pages import experiments
from bywire.server.pages import refusal_page
from bywire.server.place import Place, place_of
from bywire.server.routes import answer
from bywire.server.service import LARGEST_FILE, Service, service_of

_METHODS: Final = ("GET", "HEAD", "POST", "PUT")
_LINGER: Final = 2.0  # s in which the rest of a rejected body is read and discarded
_HEADERS: Final = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Handler(BaseHTTPRequestHandler):
    """Handler of a connection's requests."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = f"bywire/{__version__}", ""
    timeout = 60.0  # s without a byte
    service: Service

    def parse_request(self) -> bool:
        """Read the request line and the headers, and reject a line without an HTTP version."""
        if not super().parse_request():
            return False
        if self.request_version == "HTTP/0.9":
            self.send_error(HTTPStatus.HTTP_VERSION_NOT_SUPPORTED)
            return False
        return True

    def do_GET(self) -> None:
        """Answer a request with any method."""
        reply = self._reply()
        with contextlib.suppress(ConnectionError, TimeoutError):  # the client has disconnected
            self._send(reply)
            if self.close_connection:
                self._linger()

    do_HEAD = do_POST = do_PUT = do_GET
    do_DELETE = do_OPTIONS = do_PATCH = do_TRACE = do_CONNECT = do_GET

    def _reply(self) -> Reply:
        try:
            return self._answered()
        except RefusedError as refused:
            return self._refused(refused.status, refused.text, refused.field)
        except BywireError as error:
            return self._refused(400, str(error))
        except (ConnectionError, TimeoutError):
            return self._refused(408, "the request arrived incomplete. Send it again")
        except OSError as error:
            if error.errno in (errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL):
                return self._refused(404, "this file does not exist, because its name is not valid")
            place = f"{error.filename}: " if error.filename else ""
            return self._refused(507, f"{place}{error.strerror or error}. Free some space there")
        except Exception as error:  # a defect ends the request, not the server
            traceback.print_exception(error)
            return self._refused(
                500,
                "this is a bug in bywire. Please report it with the lines that the server printed",
            )

    def _answered(self) -> Reply:
        port = int(self.connection.getsockname()[1])
        guard.require_place(self.command, self.headers, port)
        try:
            address = urlsplit(self.path)
        except ValueError:  # brackets without an address, for example
            raise RefusedError(400, f"{quoted(self.path)} is not a valid address") from None
        query = dict(parse_qsl(address.query, keep_blank_values=True))
        guard.require_token(self.headers, query, port, self.service.token)
        if self.command not in _METHODS:
            raise RefusedError(405, f"{self.command} is not supported. Use {', '.join(_METHODS)}")
        request = Request(
            self.command, unquote(address.path), query, self.headers, self._body(), self._length()
        )
        if "token" in query and self.command in ("GET", "HEAD"):
            return self._welcomed(request.path, port)
        return answer(self.service, request)

    def _welcomed(self, path: str, port: int) -> Reply:
        """Store the token in a cookie, and redirect to the same address without it."""
        others = "&".join(
            part for part in urlsplit(self.path).query.split("&") if not part.startswith("token=")
        )
        cookie = (
            f"{guard.cookie_name(port)}={self.service.token}; Path=/; HttpOnly; SameSite=Strict"
        )
        # A single slash, because two slashes would mean another host.
        target = f"/{urlsplit(self.path).path.lstrip('/')}" + (f"?{others}" if others else "")
        return Reply(b"", status=303, headers={"Location": target, "Set-Cookie": cookie})

    def _length(self) -> int:
        text = self.headers.get("Content-Length", "")
        if self.headers.get("Transfer-Encoding"):
            return -1
        return int(text) if text.isascii() and text.isdecimal() and len(text) < 16 else -1

    def handle_expect_100(self) -> bool:
        """Send "100 Continue" only when the request is accepted."""
        return True

    def _body(self) -> _Body:
        return _Body(self)

    def _refused(self, status: int, text: str, field: str = "") -> Reply:
        text = shortened(text)
        if self.path.startswith("/api/"):
            body = json.dumps({"error": text, **({"field": field} if field else {})}).encode()
            return Reply(body, "application/json", status, REFUSAL)
        return Reply(refusal_page(status, text).encode(), status=status, policy=REFUSAL)

    def _send(self, reply: Reply) -> None:
        body = reply.body
        size = body.stat().st_size if isinstance(body, Path) else len(body)
        self.send_response(reply.status)
        if any(name in self.headers for name in ("Content-Length", "Transfer-Encoding")):
            self.close_connection = True  # or the unread body would be parsed as a request
        headers = {
            **_HEADERS,
            "Content-Type": reply.kind,
            "Content-Length": str(size),
            "Content-Security-Policy": reply.policy,
            **reply.headers,
            **({"Connection": "close"} if self.close_connection else {}),
        }
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command == "HEAD":
            return
        if isinstance(body, Path):
            with body.open("rb") as stream:
                shutil.copyfileobj(stream, self.wfile)
        else:
            self.wfile.write(body)

    def _linger(self) -> None:
        """Read the rest of a body. A client that is cut off while sending never reads the reply."""
        until = time.monotonic() + _LINGER
        with contextlib.suppress(OSError):  # the client has disconnected, or has stopped sending
            self.connection.shutdown(socket.SHUT_WR)
            while (left := until - time.monotonic()) > 0.0:
                self.connection.settimeout(left)
                if not self.connection.recv(1 << 16):
                    return

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Reply to a request that is not valid HTTP, always with a status line."""
        self.close_connection = True
        self.request_version = self.protocol_version
        if code == HTTPStatus.NOT_IMPLEMENTED:
            code, message = (
                405,
                f"{quoted(self.command)} is not supported. Use {', '.join(_METHODS)}",
            )
        elif code == HTTPStatus.HTTP_VERSION_NOT_SUPPORTED:
            code, message = 400, "this version of HTTP is not supported. Use HTTP/1.1"
        status = HTTPStatus(code)
        body = refusal_page(code, message or status.phrase).encode()
        self.send_response(code)
        for name, value in {
            **_HEADERS,
            "Content-Type": "text/html; charset=utf-8",
            "Connection": "close",
            "Content-Length": str(len(body)),
            "Content-Security-Policy": REFUSAL,
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing, because a line would contain the token."""


class _Body:
    """Body of a request. Its first read sends "100 Continue" if the client expects this."""

    def __init__(self, handler: Handler) -> None:
        self._handler = handler
        self._is_awaited = handler.headers.get("Expect", "").lower() == "100-continue"

    def read(self, size: int) -> bytes:
        """Return ``size`` bytes, or fewer if the client has disconnected."""
        if self._is_awaited:
            self._is_awaited = False
            self._handler.wfile.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        return self._handler.rfile.read(size)


def _quiet_error(*_: object) -> None:
    """Print an error outside of requests, unless a client has disconnected."""
    error = sys.exc_info()[1]
    if error is not None and not isinstance(error, (ConnectionError, TimeoutError)):
        traceback.print_exception(error)


# --- The server


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128  # waiting connections: the standard library's 5 cut many off
    allow_reuse_address = os.name == "posix"  # elsewhere it lets two servers share a port
    handle_error = _quiet_error  # type: ignore[assignment]


@dataclass(frozen=True)
class Opened:
    """Listening server.

    Parameters
    ----------
    server, service
        The HTTP server, and its resources.
    link
        Address with the token.
    """

    server: ThreadingHTTPServer
    service: Service
    link: str

    @property
    def port(self) -> int:
        """Port on which the server listens."""
        return int(self.server.server_address[1])


@contextmanager
def opened(
    subject: str | Path = "",
    *,
    port: int = PORT,
    folder: str | Path = "",
    largest: int = LARGEST_FILE,
) -> Iterator[Opened]:
    """Yield a listening server, which replies once its ``server.serve_forever()`` is called.

    Parameters
    ----------
    subject, port, folder
        See `serve`.
    largest
        Maximum size of an uploaded measurement, in bytes.

    Raises
    ------
    InputError
        See `serve`.
    """
    place, bench = _asked(str(subject), str(folder))
    if not 0 <= port < 65536:
        raise not_valid(_flag("port"), f"{port}", "0 to 65535")
    try:
        handler = type("FolderHandler", (Handler,), {})
        server = _Server((HERE, port), handler)
    except OSError as error:
        raise _taken(port, error) from None
    with server:
        try:
            with service_of(place, place.root, largest) as service:
                setattr(handler, "service", service)  # noqa: B010 - made here, for this folder
                path = f"/bench?of={quote(bench, safe='')}&" if bench else "/?"
                number = server.server_address[1]
                yield Opened(server, service, f"http://{HERE}:{number}{path}token={service.token}")
        except OSError as error:
            raise FileError(
                f"{place.root}: {error.strerror or error}. Choose a folder to which you can write "
                f"with {_flag('folder')}, or free some space",
                name=_flag("folder"),
                value=str(place.root),
            ) from None


@checked
def serve(
    subject: str | Path = "",
    *,
    port: int = PORT,
    folder: str | Path = "",
    say: Callable[[str], None] = print,
) -> None:
    """Show a folder's benches, results and studies in this machine's browser until Ctrl-C.

    Live pages compute in the browser, like those of `bywire.page`. Tasks that need Python (reports,
    replay of measurements, identification, design, campaigns) run in separate processes. The server
    accepts only requests from this machine that contain the link's token. It neither reads nor
    writes files outside the folder.

    Parameters
    ----------
    subject
        Bench file, experiment or folder. Default: the current folder.
    port
        Port, 1 to 65535. 0 selects a free port.
    folder
        Folder to serve. Default: the bench file's folder, or the current folder.
    say
        Called with the link.

    Returns
    -------
    None
        Never, because it runs until it is interrupted.

    Raises
    ------
    FileError
        If the folder does not exist or is not writable, or the bench file is outside the folder.
    ParameterError
        If the port is in use.
    UnknownNameError
        If the experiment is unknown.
    KeyboardInterrupt
        At the end, after jobs have ended and temporary files are removed.
    """
    with _ended_as_by_ctrl_c(), opened(subject, port=port, folder=folder) as it:
        say(it.link)
        it.server.serve_forever()


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """Make a termination signal, or a closed terminal, end a server as cleanly as Ctrl-C."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = ("SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = [(number, signal.signal(number, signal.default_int_handler)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def _asked(subject: str, folder: str) -> tuple[Place, str]:
    """Return the folder to serve, and the bench to show first, if any."""
    if subject and Path(subject).is_dir():
        if folder and Path(folder).resolve() != Path(subject).resolve():
            raise ParameterError(
                f"{subject} and {_flag('folder')} {folder} are two folders, but bywire serves only "
                f"one. Type 'bywire serve {subject}' or 'bywire serve {folder}'",
                name=_flag("folder"),
                value=str(folder),
            )
        return place_of(Path(subject)), ""
    if not is_file_name(subject):
        if subject and subject not in (known := experiments()):
            raise unknown_name("experiment or folder", subject, known)
        return place_of(Path(folder or ".")), subject
    file = Path(subject).resolve()
    if not file.is_file():
        raise FileError(
            f"{subject} does not exist. Specify a bench file, an experiment or a folder",
            name=str(subject),
        )
    place = place_of(Path(folder) if folder else file.parent)
    if not file.is_relative_to(place.root):
        raise FileError(
            f"{subject} is not in {place.root}. Specify a folder that contains it with "
            f"{_flag('folder')}",
            name=str(subject),
            value=str(place.root),
        )
    return place, place.named(file)


def _flag(argument: str) -> str:
    return f"--{argument}" if is_command_line() else argument


def _taken(port: int, error: OSError) -> ParameterError:
    if error.errno == errno.EADDRINUSE:
        return ParameterError(
            f"port {port} is in use, perhaps by another 'bywire serve'. Use the link that it "
            f"printed, or {_flag('port')} 0 for a free port",
            name=_flag("port"),
            value=str(port),
        )
    return ParameterError(
        f"port {port}: {error.strerror or error}. Use {_flag('port')} 0 for a free port",
        name=_flag("port"),
        value=str(port),
    )
