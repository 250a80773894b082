"""Self-contained file that plays a scene: drawing, numbers and player."""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from string import Template

import numpy as np

from bywire.report.animation.scene import Frames, Scene
from bywire.report.inline_script import admitted

_DIGITS = 4
_KEYS = ("x", "y", "turn", "stretch")


def scene_page(scene: Scene, title: str, summary: str) -> str:
    """Return the HTML of a page that plays a scene.

    Parameters
    ----------
    scene
        The scene.
    title, summary
        Its heading and the line below it, as plain text.
    """
    folder = files(__package__)
    script, style = (folder.joinpath(name).read_text() for name in ("player.js", "player.css"))
    page = Template(folder.joinpath("player.html").read_text())
    return page.substitute(
        policy=f"default-src 'none'; script-src {admitted(script)}; style-src {admitted(style)}",
        title=escape(title),
        summary=escape(summary),
        style=style,
        script=script,
        width=f"{scene.width:g}",
        height=f"{scene.height:g}",
        drawing=scene.drawing,
        data=json.dumps(_numbers(scene), separators=(",", ":")).replace("<", "\\u003c"),
        last=str(scene.time.size - 1),
    )


def _numbers(scene: Scene) -> dict[str, object]:
    moves = {
        part: {key: _plain(getattr(move, key)) for key in _KEYS}
        for part, move in scene.moves.items()
    }
    dials = [
        {
            "label": dial.label,
            "unit": dial.unit,
            "full": dial.full,
            "color": dial.color,
            "values": _plain(dial.values),
        }
        for dial in scene.dials
    ]
    return {"time": _plain(scene.time), "moves": moves, "dials": dials}


def _plain(values: Frames) -> object:
    rounded = np.round(values, _DIGITS) + 0.0  # no -0.0
    return rounded.tolist()
