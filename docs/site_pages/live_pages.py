"""Page with benches that run in the reader's browser."""

from __future__ import annotations

from pathlib import Path

import bywire
from site_pages.markdown import plain

ROOT = Path(__file__).parents[2]
BENCHES = {
    "hard-braking": (
        "Motorcycle brake: a step in the brake pressure",
        "hard-braking",
        ("seal.T_pr", "ecu.dither.gain", "ecu.pressure.k_p", "motor.R_m"),
    ),
    "moment-pulses": (
        "Wedge brake: pulses of the brake moment",
        "moment-pulses",
        ("wedge.mu_B", "control.moment.f_c"),
    ),
}


def write(folder: Path) -> None:
    """Write each bench as one page into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (_, bench, vary) in BENCHES.items():
        bywire.page(bench, folder / f"{name}.html", vary=vary)


def page() -> str:
    """Return the page that contains them."""
    lines = [
        "---",
        "html_theme.sidebar_secondary.remove: true",
        "---",
        "",
        "# Live benches",
        "",
        "The brake's own kernel, compiled to WebAssembly, runs in this page. Move a slider to "
        "update the curves and key figures. The page does not send any data. To create such a "
        "page for your own bench, see [](../page.md).",
        "",
    ]
    for name, (title, *_) in BENCHES.items():
        lines += [
            f"## {plain(title)}",
            "",
            f'<a href="../live/{name}.html">Open in its own tab</a>',
            "",
            "```{raw} html",
            f'<iframe class="bench" src="../live/{name}.html" title="{title}" loading="lazy">'
            "</iframe>",
            "```",
            "",
        ]
    return "\n".join(lines)
