"""What a browser shows of a request that was refused."""

from __future__ import annotations

from bywire.server.pages.entries import text


def refusal_page(status: int, said: str) -> str:
    """Return a page without style or script: who sees it may not have the token."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{status}</title>\n</head>\n<body>\n<h1>bywire: {status}</h1>\n"
        f"<p>{text(said)}</p>\n</body>\n</html>\n"
    )
