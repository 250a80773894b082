"""Benches that compute in the reader's browser."""

from __future__ import annotations

from pathlib import Path

import bywire
from site_pages.markdown import plain

ROOT = Path(__file__).parents[2]
BENCHES = {
    "hard-braking": (
        "A step of the brake pressure, the motorcycle brake",
        "hard-braking",
        ("seal.T_pr", "ecu.dither.gain", "ecu.pressure.k_p", "motor.R_m"),
    ),
    "moment-pulses": (
        "Pulses of the brake moment, the wedge brake",
        "moment-pulses",
        ("wedge.mu_B", "control.moment.f_c"),
    ),
}


def write(folder: Path) -> None:
    """Write each bench as a page of its own into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (_, bench, vary) in BENCHES.items():
        bywire.page(bench, folder / f"{name}.html", vary=vary)


def page() -> str:
    """Return the page in which they stand."""
    lines = [
        "---",
        "html_theme.sidebar_secondary.remove: true",
        "---",
        "",
        "# Live benches",
        "",
        "The brake's own kernel, compiled to WebAssembly, runs in this page: move a slider, and "
        "all that a run shows follows. Nothing is sent anywhere. How to make such a file of a "
        "bench of your own: [](../page.md).",
        "",
    ]
    for name, (title, *_) in BENCHES.items():
        lines += [
            f"## {plain(title)}",
            "",
            f'<a href="../live/{name}.html">Open it alone</a>',
            "",
            "```{raw} html",
            f'<iframe class="bench" src="../live/{name}.html" title="{title}" loading="lazy">'
            "</iframe>",
            "```",
            "",
        ]
    return "\n".join(lines)
