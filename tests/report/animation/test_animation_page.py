"""The page that plays a scene: self-contained, with one number per frame."""

from __future__ import annotations

import base64
import hashlib
import json
import re

import numpy as np
import xarray as xr

from bywire.report.animation.scene import Dial, Move, Scene, frames_of, scene_page


def scene() -> Scene:
    time = np.array([0.0, 0.02, 0.04])
    moves = {"wheel": Move(x=-100.0 * time, turn=time, stretch=0.5)}
    dial = Dial("speed", "km/h", np.array([10.0, 5.0, 0.0]), 20.0, "#000000")
    return Scene(time, 700.0, 300.0, '<g id="wheel"/>', moves, (dial,))


def test_numbers_come_through() -> None:
    page = scene_page(scene(), "a <stop>", "what is seen")
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    data = json.loads(text)
    assert data["time"] == [0.0, 0.02, 0.04]
    assert data["moves"]["wheel"] == {
        "x": [0.0, -2.0, -4.0],
        "y": 0.0,
        "turn": [0.0, 0.02, 0.04],
        "stretch": 0.5,
    }
    assert data["dials"][0]["values"] == [10.0, 5.0, 0.0]
    assert "a &lt;stop&gt;" in page
    assert "-0.0" not in text


def test_policy_admits_what_the_page_runs_and_no_more() -> None:
    page = scene_page(scene(), "stop", "")
    for tag in ("style", "script"):
        (content,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in page
    assert "default-src 'none'" in page
    assert "http://" not in page.replace("http://www.w3.org/2000/svg", "")


def test_frames_begin_with_time_zero() -> None:
    run = xr.Dataset({"v": ("time", np.zeros(5))}, {"time": np.linspace(-0.1, 0.1, 5)})
    np.testing.assert_allclose(frames_of(run), 0.02 * np.arange(6), atol=1e-12)
