"""An HTML file of the folder that fills a tab."""

from __future__ import annotations

from urllib.parse import quote

from bywire.server.pages.entries import text


def report_page(name: str) -> str:
    """Return a page that holds a file in a frame, which the policy of this page keeps here.

    What a frame leads to, by its script, by a link or after some time, its holder's policy admits
    or not. A page that is alone in its tab has no holder.
    """
    address = text(quote(f"/file/{name}"))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{text(name)}</title>
<link rel="stylesheet" href="/assets/serve.css">
</head>
<body class="whole">
<iframe title="{text(name)}" src="{address}" sandbox="allow-scripts allow-downloads"></iframe>
</body>
</html>
"""
