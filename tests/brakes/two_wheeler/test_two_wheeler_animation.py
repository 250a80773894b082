"""The stop as a moving picture: what turns, what marks the road, and where there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.brakes.two_wheeler.animations import STOP
from bywire.core.errors import ParameterError

LOCKED = {
    "options.v_0": "5 m/s",
    "options.surface": "snow",
    "options.duration": "0.6 s",
    "ecu.abs": "off",
}


def test_wheel_turns_until_it_stands_and_then_marks_the_road(tmp_path: Path) -> None:
    result = bywire.run("straight-stop", LOCKED, estimate_error=False, animate=True)
    run = result.recording
    scene = STOP.draw(run)
    turn = np.unwrap(np.asarray(scene.moves["wheel-0"].turn))
    frames = np.arange(0.0, 0.6 + 1e-9, 0.02)
    np.testing.assert_allclose(scene.time, frames)
    wanted = np.interp(frames, run["time"], np.cumsum(run["v_f"]) * 1e-3 / 0.3)
    np.testing.assert_allclose(turn, wanted, atol=0.02)
    assert turn[-1] == turn[-5]
    np.testing.assert_allclose(
        scene.moves["road"].x, -100.0 * np.interp(frames, run["time"], run["x"])
    )
    _, marks = scene.drawing.split('<g id="marks-0">')
    assert 'fill="#1A1A1A"' in marks.split("</g>")[0]
    page = next(a for a in result.document().attachments if a.name == "animation.html")
    assert "animation" in page.write(tmp_path / page.name).name


def test_refuses_what_does_not_drive() -> None:
    with pytest.raises(ParameterError, match=r"motorcycle-brake has no animation"):
        bywire.run("hard-braking", animate=True)
    with pytest.raises(ParameterError, match="single run"):
        bywire.run("straight-stop", over="vehicle.road.grip=0.5, 1", animate=True)
