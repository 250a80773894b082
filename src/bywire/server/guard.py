"""Access control, which accepts only requests from this machine with the link's token.

A page on another site can send requests to this machine. With a host name that resolves to this
machine, the page could even read the replies. The headers Host, Origin and Sec-Fetch-Site identify
such requests. The token excludes other users and programs on this machine.
"""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from email.message import Message
from http.cookies import CookieError, SimpleCookie
from typing import Final

from bywire.server.address import HERE, NAMES
from bywire.server.exchange import RefusedError

_PLAIN: Final = 80
"""default port of HTTP, which URLs omit"""
_HERE: Final = ("same-origin", "none")


def new_token() -> str:
    """Return a token that nobody can guess."""
    return secrets.token_urlsafe(32)


def cookie_name(port: int) -> str:
    """Return the cookie's name. Browsers share cookies between the ports of a machine."""
    return f"bywire-{port}"


def require_place(method: str, headers: Message, port: int) -> None:
    """Reject requests to another host name, or from a page on another site.

    Raises
    ------
    RefusedError
        With status 421 for a foreign Host, and 403 for a foreign page.
    """
    host = headers.get("Host", "").lower()
    if port == _PLAIN:
        host = host.removesuffix(f":{port}")  # browsers omit it, but other clients may not
    if host not in {name if port == _PLAIN else f"{name}:{port}" for name in NAMES}:
        raise RefusedError(
            421, f"this server answers only as {HERE}:{port}. Open the link that it printed"
        )
    origin = headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        raise RefusedError(403, "a page on another site sent this request. Use this server's pages")
    is_visit = method in ("GET", "HEAD") and headers.get("Sec-Fetch-Mode") == "navigate"
    if headers.get("Sec-Fetch-Site", "none") not in _HERE and not is_visit:
        raise RefusedError(403, "a page on another site sent this request. Use this server's pages")


def require_token(headers: Message, query: Mapping[str, str], port: int, token: str) -> None:
    """Reject requests without the token in the link or the cookie.

    Raises
    ------
    RefusedError
        With status 401.
    """
    given = [query["token"]] if "token" in query else _kept(headers, port)
    if not given:
        raise RefusedError(
            401, "the token is missing. Open the complete link that 'bywire serve' printed"
        )
    if not any(secrets.compare_digest(each.encode(), token.encode()) for each in given):
        raise RefusedError(
            401,
            "the token is not valid, because the server creates a new token at each start. Open "
            "the link that 'bywire serve' printed last",
        )


def _kept(headers: Message, port: int) -> list[str]:
    """Return the token in the cookie, if there is one."""
    try:
        kept = SimpleCookie(headers.get("Cookie", "")).get(cookie_name(port))
    except CookieError:
        return []
    return [kept.value] if kept is not None else []
