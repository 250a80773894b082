"""Who may ask: only who has the link, from this machine, and from no other site's page.

A page of another site can send requests to this machine (and, by a name that it lets point here,
even read the answers): the name in Host, the site in Origin and what the browser says of where a
request comes from tell those apart. The token tells other users and programs of this machine apart.
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
"""the port of HTTP, which addresses leave out"""
_HERE: Final = ("same-origin", "none")


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(32)


def cookie_name(port: int) -> str:
    """Return the name of the cookie; browsers share cookies between the ports of a machine."""
    return f"bywire-{port}"


def require_place(method: str, headers: Message, port: int) -> None:
    """Refuse what was sent to another name, or by a page of another site.

    Raises
    ------
    RefusedError
        With status 421 for a foreign Host, and 403 for a foreign page.
    """
    host = headers.get("Host", "").lower()
    if port == _PLAIN:
        host = host.removesuffix(f":{port}")  # browsers leave it out, others may not
    if host not in {name if port == _PLAIN else f"{name}:{port}" for name in NAMES}:
        raise RefusedError(
            421, f"this server answers as {HERE}:{port} only: open the link that it printed"
        )
    origin = headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        raise RefusedError(
            403, "another site's page sent this request: use the pages of this server"
        )
    is_visit = method in ("GET", "HEAD") and headers.get("Sec-Fetch-Mode") == "navigate"
    if headers.get("Sec-Fetch-Site", "none") not in _HERE and not is_visit:
        raise RefusedError(
            403, "another site's page sent this request: use the pages of this server"
        )


def require_token(headers: Message, query: Mapping[str, str], port: int, token: str) -> None:
    """Refuse who has not the token, in the link or kept as a cookie.

    Raises
    ------
    RefusedError
        With status 401.
    """
    given = [query["token"]] if "token" in query else _kept(headers, port)
    if not given:
        raise RefusedError(
            401, "the token is missing: open the whole link that 'bywire serve' printed"
        )
    if not any(secrets.compare_digest(each.encode(), token.encode()) for each in given):
        raise RefusedError(
            401,
            "the token is not this server's (a new one is made at each start): open the link that "
            "'bywire serve' printed last",
        )


def _kept(headers: Message, port: int) -> list[str]:
    """Return the token of the cookie, if there is one."""
    try:
        kept = SimpleCookie(headers.get("Cookie", "")).get(cookie_name(port))
    except CookieError:
        return []
    return [kept.value] if kept is not None else []
