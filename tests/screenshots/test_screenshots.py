"""Screenshots: what is seen of planted changes, and a page of the site as it is stored."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from screenshots.compared import difference
from screenshots.subjects import SUBJECTS, without_site
from screenshots.taken import STORED, THEMES, differing, stored, taken

NAMES = [f"{name}-{theme}" for name in SUBJECTS for theme in THEMES]
LIGHT = [name for name in NAMES if name.endswith("light")]
PAGES = [name for name in LIGHT if name.startswith("page")]
MOST = 40_000  # bytes


def test_what_is_stored_is_what_is_taken_and_small():
    assert {path.stem for path in STORED.glob("*.png")} == {*NAMES}
    assert max(path.stat().st_size for path in STORED.glob("*.png")) <= MOST


@pytest.mark.parametrize("name", LIGHT)
def test_antialiasing_and_a_pixel_to_the_side_are_not_seen(name):
    shot, rng = stored(name), np.random.default_rng(1)
    smooth = gaussian_filter(shot.astype(float), (0.3, 0.3, 0)) + rng.normal(0.0, 4.0, shot.shape)
    assert not difference(shot, np.clip(smooth, 0, 255).astype(np.uint8)).is_seen
    assert not difference(shot, np.roll(shot, 1, axis=1)).is_seen


@pytest.mark.parametrize("name", LIGHT)
def test_the_other_theme_is_seen(name):
    assert difference(stored(name), stored(name.replace("light", "dark"))).share > 0.5


@pytest.mark.parametrize("name", PAGES)
def test_a_panel_that_is_shifted_or_empty_is_seen(name):
    shot = stored(name)
    left, top, bottom = shot.shape[1] // 2, 260, 360  # in the panels of the page
    lower = shot.copy()
    lower[top:bottom, left:] = np.roll(lower[top:bottom, left:], 4, axis=0)
    assert difference(shot, lower).is_seen
    empty = shot.copy()
    empty[top:bottom, left:] = np.median(shot[top:bottom, left:], axis=(0, 1))
    assert difference(shot, empty).is_seen


def test_another_size_is_seen():
    shot = stored(NAMES[0])
    assert difference(shot, shot[:-1]).is_seen


@pytest.mark.skipif(bool(without_site()), reason=without_site())
def test_a_page_of_the_site_looks_as_it_is_stored(chromium, tmp_path):
    address = SUBJECTS["site"].write(tmp_path).as_uri()
    assert not differing("site", taken(chromium, address))
