"""Scenes that move like a recording, and the self-contained page that plays a scene."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.registry import Kind, instances
from bywire.core.typing import Array
from bywire.report.inline_script import admitted

if TYPE_CHECKING:
    import xarray as xr

Frames = Array | float


@dataclass(frozen=True)
class Move:
    """Motion of a part of the drawing: over the frames, or constant.

    Parameters
    ----------
    x, y
        Shift in units of the drawing, y downward, shape (frames,) or a number.
    turn
        Angle about the part's origin [rad], clockwise.
    stretch
        Factor on the part's width.
    """

    x: Frames = 0.0
    y: Frames = 0.0
    turn: Frames = 0.0
    stretch: Frames = 1.0


@dataclass(frozen=True)
class Dial:
    """A bar next to the drawing.

    Parameters
    ----------
    label, unit
        Label, and unit of the values.
    values
        Values at the frames, in that unit, shape (frames,).
    full
        Value at which the bar is full.
    color
        Color of the bar, as in CSS.
    """

    label: str
    unit: str
    values: Array
    full: float
    color: str


@dataclass(frozen=True)
class Scene:
    """An animation.

    Parameters
    ----------
    time
        Times of the frames [s], shape (frames,), evenly spaced.
    width, height
        Size of the drawing, in its own units.
    drawing
        SVG markup; moving parts are groups whose ``id`` is a key of ``moves``.
    moves
        Motion of each of these parts.
    dials
        Bars below the drawing.
    """

    time: Array
    width: float
    height: float
    drawing: str
    moves: Mapping[str, Move]
    dials: tuple[Dial, ...]


@dataclass(frozen=True)
class SceneKind:
    """Animation of the runs of an assembly.

    Parameters
    ----------
    name
        The assembly.
    place
        Required signal of a recording: the position of the vehicle.
    draw
        ``draw(recording)``: its scene.
    """

    name: str
    place: str
    draw: Callable[[xr.Dataset], Scene]


def frames_of(run: xr.Dataset, per_second: float = 50.0) -> Array:
    """Return the times of frames [s] from time zero to the end of a recording, shape (frames,)."""
    return np.arange(0.0, float(run["time"].values[-1]) + 1e-9, 1.0 / per_second)


def over_frames(run: xr.Dataset, name: str, frames: Array) -> Any:
    """Return a recorded signal at the times of frames [s], shape (frames,)."""
    return np.interp(frames, run["time"].values, run[name].values)


SCENES = Kind("animation", ("animations",), instances(SceneKind), declared="a SceneKind")
"""animations of runs, by the assembly's name"""


# --- The page

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
