"""A request as routes see it, what they answer, and what a server refuses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from email.message import Message
from pathlib import Path
from typing import Any, Protocol


class RefusedError(Exception):
    """A request that is not answered as it wanted.

    Parameters
    ----------
    status
        Of HTTP.
    text
        What is wrong, and what to do.
    field
        Of the form, beside which it is shown; none where it is no field's.
    """

    def __init__(self, status: int, text: str, field: str = "") -> None:
        super().__init__(text)
        self.status, self.text, self.field = status, text, field


# --- Requests and answers

LARGEST_FORM = 200_000
"""bytes of a form"""
PAGES = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""policy of the server's own pages"""
REFUSAL = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
"""policy of what is refused, which a frame of a page may show"""
LIVE = "frame-ancestors 'self'"
"""policy of live pages beside the strict one that stands in each"""
SANDBOX = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline' "
    "'wasm-unsafe-eval'; worker-src blob:; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""policy of files of the folder: whatever runs in them has no origin, no cookie and no network"""


class Body(Protocol):
    """What a request's body is read from."""

    def read(self, size: int) -> bytes:
        """Return so many bytes, fewer only where the other side has left."""
        ...


@dataclass(frozen=True)
class Request:
    """What is asked.

    Parameters
    ----------
    method, path, query
        From the first line, decoded.
    headers
        As they were sent.
    body, length
        Where the body is read from, and its bytes; -1 where it is not said.
    """

    method: str
    path: str
    query: Mapping[str, str]
    headers: Message
    body: Body
    length: int

    def form(self) -> dict[str, Any]:
        """Return the object that was sent as JSON.

        Raises
        ------
        RefusedError
            With status 415, 411, 413 or 400 where there is none.
        """
        if self.headers.get("Content-Type", "").partition(";")[0].strip() != "application/json":
            raise RefusedError(415, "a form is sent as application/json: use the page's button")
        self.require_length(LARGEST_FORM, "a form")
        try:
            said = json.loads(self.body.read(self.length))
        except (ValueError, RecursionError):
            said = None
        if not isinstance(said, dict):
            raise RefusedError(400, "the form is not a JSON object: use the page's button")
        return said

    def require_length(self, most: int, what: str) -> None:
        """Refuse a body whose length is not said, or too large.

        Raises
        ------
        RefusedError
            With status 411 or 413.
        """
        if self.length < 0:
            raise RefusedError(411, f"{what} needs a Content-Length: send it as one piece")
        if self.length > most:
            raise RefusedError(
                413,
                f"{what} of {self.length / 1e6:,.1f} MB is too large (at most "
                f"{most / 1e6:,.1f} MB): copy it into the served folder, or make it smaller with "
                "'bywire convert'",
            )


@dataclass(frozen=True)
class Reply:
    """What is answered.

    Parameters
    ----------
    body
        Bytes, or the file that has them.
    kind
        Content type.
    status
        Of HTTP.
    policy
        Content security policy.
    headers
        Further ones.
    """

    body: bytes | Path
    kind: str = "text/html; charset=utf-8"
    status: int = 200
    policy: str = PAGES
    headers: Mapping[str, str] = field(default_factory=dict)


def page(text: str) -> Reply:
    """Return one of the server's own pages."""
    return Reply(text.encode())


def plain(said: Mapping[str, Any], status: int = 200) -> Reply:
    """Return a JSON object; what is not defined becomes null."""
    from bywire.report.answer import finite

    return Reply(json.dumps(finite(dict(said))).encode(), "application/json", status)
