"""Animation of a stop: wheels, marks on the road, forces, and dials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.typing import Array
from bywire.plant import road
from bywire.report import style
from bywire.report.animation.scene import Dial, Move, Scene, frames_of, over_frames
from bywire.report.channel import phases
from bywire.vehicle.surfaces import surface_name

if TYPE_CHECKING:
    import xarray as xr

SCALE = 100.0
"""drawing units per meter"""
TINTS = {
    "dry-asphalt": style.GRAY,
    "wet-asphalt": style.BLUE,
    "dry-concrete": style.YELLOW,
    "dry-cobble": style.ORANGE,
    "wet-cobble": style.GREEN,
    "snow": style.SKY,
    "ice": style.PURPLE,
    "own": style.PALE,
}
"""color of each surface"""
_WIDTH, _HEIGHT, _CONTACT = 720.0, 300.0, (500.0, 225.0)
_LOADED = 1.0  # N; an unloaded wheel leaves no mark
_POST = 5.0  # m between posts along the road
_ARROW = 100.0  # length of an arrow for a force equal to the weight
_SPOKES = 5


@dataclass(frozen=True)
class Wheel:
    """A wheel with its signals.

    Parameters
    ----------
    behind
        Distance behind the first contact [m].
    r
        Radius [m].
    omega, sliding, load, force
        Signals of its speed, its tire's sliding, its load and its braking force.
    """

    behind: float
    r: float
    omega: str
    sliding: str
    load: str
    force: str


def stop_scene(
    run: xr.Dataset,
    ways: road.Parameters,
    wheels: Sequence[Wheel],
    body: str,
    dials: Sequence[tuple[str, str, str, float, float, str]],
    *,
    place: str,
    weight: float,
    pitch: str = "",
) -> Scene:
    """Return the scene of a vehicle that stops on a straight road.

    Parameters
    ----------
    run
        Recording, with time zero at the start of braking.
    ways
        The road.
    wheels
        The wheels; the first one is at the vehicle's front contact.
    body
        SVG markup of the body, with its origin at the first contact and y downward.
    dials
        Signal, label, unit, factor to this unit, full-scale value, and color of each bar.
    place
        Signal of the first wheel's traveled distance [m].
    weight
        Force with an arrow of one meter [N].
    pitch
        Signal of the angle about the first contact [rad], nose down; empty without pitch.
    """
    frames = frames_of(run)
    gone = over_frames(run, place, frames)
    slope = np.array([np.arcsin(road.slope(x, ways).sine) for x in gone])
    moves = {"slope": Move(turn=-slope), "road": Move(x=-SCALE * gone)}
    if pitch:
        moves["body"] = Move(turn=over_frames(run, pitch, frames))
    time = run["time"].values
    for k, wheel in enumerate(wheels):
        omega = run[wheel.omega].values
        turned = np.append(0.0, np.cumsum(0.5 * (omega[1:] + omega[:-1]) * np.diff(time)))
        moves[f"wheel-{k}"] = Move(turn=np.interp(frames, time, turned) % (2.0 * np.pi))
        moves[f"force-{k}"] = Move(stretch=over_frames(run, wheel.force, frames) / weight)
        moves[f"marks-{k}"] = moves["road"]
    return Scene(
        frames,
        _WIDTH,
        _HEIGHT,
        _drawing(run, ways, wheels, body, place),
        moves,
        tuple(
            Dial(label, unit, factor * over_frames(run, name, frames), full, color)
            for name, label, unit, factor, full, color in dials
        ),
    )


def _drawing(
    run: xr.Dataset, ways: road.Parameters, wheels: Sequence[Wheel], body: str, place: str
) -> str:
    far = float(np.max(run[place].values))
    clips = "".join(
        f'<clipPath id="gone-{k}"><rect x="-2000" y="0" height="20" '
        f'width="{2000 - SCALE * wheel.behind:g}"/></clipPath>'
        for k, wheel in enumerate(wheels)
    )
    marks = "".join(
        f'<g clip-path="url(#gone-{k})"><g id="marks-{k}">{_marks(run, wheel, place, k)}</g></g>'
        for k, wheel in enumerate(wheels)
    )
    first, *others = (_wheel(wheel, k) for k, wheel in enumerate(wheels))
    arrows = "".join(_arrow(wheel, k) for k, wheel in enumerate(wheels))
    return (
        f'<defs>{clips}</defs><g transform="translate({_CONTACT[0]:g} {_CONTACT[1]:g})">'
        f'<g id="slope"><g id="road">{"".join(_road(ways, far))}</g>{marks}'
        f'<g id="body">{body}{"".join(others)}</g>{first}{arrows}</g></g>'
    )


def _road(ways: road.Parameters, far: float) -> Iterator[str]:
    """Yield the surfaces with their names, and posts with their distances."""
    begin, end = -_CONTACT[0] / SCALE - 2.0, far + 5.0
    edges = sorted({begin, end, *(x for x in (ways.x_change, ways.x_back) if begin < x < end)})
    for left, right in pairwise(edges):
        name = surface_name(0.5 * (left + right), ways)
        yield (
            f'<rect x="{SCALE * left:.0f}" y="0" width="{SCALE * (right - left):.0f}" height="20" '
            f'fill="{TINTS[name]}" fill-opacity="0.35"/>'
        )
    for n in range(int(begin // _POST) + 1, int(end // _POST) + 1):
        x, name = SCALE * _POST * n, surface_name(_POST * n, ways)
        yield (
            f'<rect x="{x - 1:.0f}" y="-14" width="2" height="14" fill="{style.GRAY}"/>'
            f'<text x="{x:.0f}" y="38" font-size="13" text-anchor="middle" '
            f'fill="{style.BLACK}">{_POST * n:g} m {escape(name.replace("-", " "))}</text>'
        )


def _marks(run: xr.Dataset, wheel: Wheel, place: str, row: int) -> str:
    """Return the marks of a sliding tire, darker for a locked wheel."""
    at: Array = np.maximum.accumulate(run[place].values) - wheel.behind
    slides = (run[wheel.sliding].values > 0.5) & (run[wheel.load].values > _LOADED)
    stands = slides & (run[wheel.omega].values == 0)
    return "".join(
        f'<rect x="{SCALE * begin:.1f}" y="{3 + 8 * row}" width="{SCALE * (end - begin):.1f}" '
        f'height="6" fill="{color}"/>'
        for flags, color in ((slides, style.VERMILLION), (stands, style.BLACK))
        for begin, end in phases(at, flags)
    )


def _wheel(wheel: Wheel, k: int) -> str:
    r = SCALE * wheel.r
    angles = [2.0 * np.pi * n / _SPOKES for n in range(_SPOKES)]
    spokes = "".join(
        f'<line x2="{0.8 * r * np.cos(a):.1f}" y2="{0.8 * r * np.sin(a):.1f}" '
        f'stroke="{style.GRAY}" stroke-width="3"/>'
        for a in angles
    )
    return (
        f'<g transform="translate({-SCALE * wheel.behind:g} {-r:g})"><g id="wheel-{k}">'
        f'<circle r="{0.9 * r:.1f}" fill="none" stroke="{style.BLACK}" '
        f'stroke-width="{0.2 * r:.1f}"/>{spokes}</g></g>'
    )


def _arrow(wheel: Wheel, k: int) -> str:
    return (
        f'<g transform="translate({-SCALE * wheel.behind:g} -4)"><g id="force-{k}">'
        f'<path d="M0 -2H{-_ARROW + 14:g}V-6L{-_ARROW:g} 0L{-_ARROW + 14:g} 6V2H0Z" '
        f'fill="{style.VERMILLION}" fill-opacity="0.8"/></g></g>'
    )
