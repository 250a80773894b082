"""Requests and replies of routes, and errors for rejected requests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from email.message import Message
from pathlib import Path
from typing import Any, Protocol


class RefusedError(Exception):
    """Request that the server rejects.

    Parameters
    ----------
    status
        HTTP status.
    text
        Description of the error, with advice.
    field
        Form field that shows the text. Empty if the error does not belong to a single field.
    """

    def __init__(self, status: int, text: str, field: str = "") -> None:
        super().__init__(text)
        self.status, self.text, self.field = status, text, field


# --- Requests and replies

LARGEST_FORM = 200_000
"""maximum size of a form in bytes"""
PAGES = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""policy of the server's own pages"""
REFUSAL = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
"""policy of error pages, which a page may show in a frame"""
LIVE = "frame-ancestors 'self'"
"""policy of live pages, in addition to the strict policy in each page"""
SANDBOX = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline' "
    "'wasm-unsafe-eval'; worker-src blob:; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""policy of the folder's files: scripts in them have no origin, no cookies and no network"""


class Body(Protocol):
    """Stream of a request's body."""

    def read(self, size: int) -> bytes:
        """Return ``size`` bytes, or fewer if the client has disconnected."""
        ...


@dataclass(frozen=True)
class Request:
    """Request from a client.

    Parameters
    ----------
    method, path, query
        From the request line, decoded.
    headers
        Headers as sent.
    body, length
        Stream of the body, and its length in bytes, or -1 if the request does not declare it.
    """

    method: str
    path: str
    query: Mapping[str, str]
    headers: Message
    body: Body
    length: int

    def form(self) -> dict[str, Any]:
        """Return the form's JSON object.

        Raises
        ------
        RefusedError
            With status 415, 411, 413 or 400 if the body is not a valid form.
        """
        if self.headers.get("Content-Type", "").partition(";")[0].strip() != "application/json":
            raise RefusedError(415, "a form must be application/json. Use the page's button")
        self.require_length(LARGEST_FORM, "a form")
        try:
            content = json.loads(self.body.read(self.length))
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise RefusedError(400, "the form is not a JSON object. Use the page's button")
        return content

    def require_length(self, most: int, what: str) -> None:
        """Reject a body whose length is undeclared or too large.

        Raises
        ------
        RefusedError
            With status 411 or 413.
        """
        if self.length < 0:
            raise RefusedError(411, f"{what} needs a Content-Length. Send it in one piece")
        if self.length > most:
            raise RefusedError(
                413,
                f"{what} of {self.length / 1e6:,.1f} MB is too large (at most "
                f"{most / 1e6:,.1f} MB). Copy it to the served folder, or reduce its size with "
                "'bywire convert'",
            )


@dataclass(frozen=True)
class Reply:
    """Reply of the server.

    Parameters
    ----------
    body
        Bytes, or the file that contains them.
    kind
        Content type.
    status
        HTTP status.
    policy
        Content security policy.
    headers
        Additional headers.
    """

    body: bytes | Path
    kind: str = "text/html; charset=utf-8"
    status: int = 200
    policy: str = PAGES
    headers: Mapping[str, str] = field(default_factory=dict)


def page(text: str) -> Reply:
    """Return a reply with an HTML page."""
    return Reply(text.encode())


def plain(said: Mapping[str, Any], status: int = 200) -> Reply:
    """Return a reply with a JSON object, in which undefined numbers become null."""
    from bywire.report.answer import finite

    return Reply(json.dumps(finite(dict(said))).encode(), "application/json", status)
