"""`bywire.serve`: the server from its start to Ctrl-C."""

from __future__ import annotations

import errno
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote

from bywire.core.arguments import checked
from bywire.core.callers import is_command_line
from bywire.core.errors import FileError, ParameterError, unknown_name
from bywire.server.address import HERE, PORT
from bywire.server.field import is_file_name
from bywire.server.handler import Handler, quiet_error
from bywire.server.live_pages import experiments
from bywire.server.place import Place, place_of
from bywire.server.service import LARGEST_FILE, Service, service_of


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128  # connections that wait: by the standard library's 5, many are cut off
    allow_reuse_address = os.name == "posix"  # elsewhere it lets two servers share a port
    handle_error = quiet_error  # type: ignore[assignment]


@dataclass(frozen=True)
class Opened:
    """A server that answers while it is served.

    Parameters
    ----------
    server, service
        What listens, and what it works with.
    link
        Address with the token.
    """

    server: ThreadingHTTPServer
    service: Service
    link: str

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self.server.server_address[1])


@contextmanager
def opened(
    subject: str | Path = "",
    *,
    port: int = PORT,
    folder: str | Path = "",
    largest: int = LARGEST_FILE,
) -> Iterator[Opened]:
    """Yield a server that listens; it answers when its ``server.serve_forever()`` is called.

    Parameters
    ----------
    subject, port, folder
        See `serve`.
    largest
        Bytes that a measurement may have that is dropped on a page.

    Raises
    ------
    InputError
        See `serve`.
    """
    place, bench = _asked(str(subject), str(folder))
    if not 0 <= port < 65536:
        raise ParameterError(f"{_flag('port')} {port} is not valid: it must be 0 to 65535")
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
                f"{place.root}: {error.strerror or error}: name a folder that you may write to "
                f"with {_flag('folder')}, and make room there"
            ) from None


@checked
def serve(
    subject: str | Path = "",
    *,
    port: int = PORT,
    folder: str | Path = "",
    say: Callable[[str], None] = print,
) -> None:
    """Show a folder's benches, results and studies in a browser of this machine, until Ctrl-C.

    Pages compute in the browser as those of `bywire.page` do; what needs Python (reports,
    measurement files beside the simulation, identification, design, campaigns) is computed in
    processes of its own. Only this machine is answered, only with the token of the link, and
    nothing is read or written outside of the folder.

    Parameters
    ----------
    subject
        Bench file, experiment or folder; by default the current folder.
    port
        Where it listens, 1 to 65535; 0 for any that is free.
    folder
        What is served; by default the folder of the bench file, or the current one.
    say
        Called with the link.

    Returns
    -------
    None
        Never: it answers until it is interrupted.

    Raises
    ------
    FileError
        For a folder that is none, or that cannot be written to, and a bench file outside of it.
    ParameterError
        For a port that is taken.
    UnknownNameError
        For an experiment that there is not.
    KeyboardInterrupt
        At the end; jobs have ended then, and temporary files are gone.
    """
    with _ended_as_by_ctrl_c(), opened(subject, port=port, folder=folder) as it:
        say(it.link)
        it.server.serve_forever()


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """Have a termination, or a terminal that is closed, end a server as Ctrl-C does: tidied up."""
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
    """Return the folder to serve, and the bench that is shown first, if any."""
    if subject and Path(subject).is_dir():
        if folder and Path(folder).resolve() != Path(subject).resolve():
            raise ParameterError(
                f"{subject} and {_flag('folder')} {folder} are two folders, and but one is "
                f"served, with all below it: bywire serve {subject}, or bywire serve {folder}"
            )
        return place_of(Path(subject)), ""
    if not is_file_name(subject):
        if subject and subject not in (known := experiments()):
            raise unknown_name("experiment or folder", subject, known)
        return place_of(Path(folder or ".")), subject
    file = Path(subject).resolve()
    if not file.is_file():
        raise FileError(f"{subject} is no file: name a bench file, an experiment or a folder")
    place = place_of(Path(folder) if folder else file.parent)
    if not file.is_relative_to(place.root):
        raise FileError(
            f"{subject} is not in {place.root}: name the folder of both with {_flag('folder')}"
        )
    return place, place.named(file)


def _flag(argument: str) -> str:
    return f"--{argument}" if is_command_line() else argument


def _taken(port: int, error: OSError) -> ParameterError:
    if error.errno == errno.EADDRINUSE:
        return ParameterError(
            f"port {port} is taken, perhaps by another 'bywire serve': use the link that it "
            f"printed, or {_flag('port')} 0 for any free one"
        )
    return ParameterError(
        f"port {port}: {error.strerror or error}: try {_flag('port')} 0 for any free one"
    )
