"""Files are complete or absent, and the same input gives the same bytes."""

from __future__ import annotations

import io
import os
import struct
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.image import imread as png_pixels

from bywire.core.errors import FileError
from bywire.report.drawing import figure_bytes, save_figure, write_bytes
from bywire.report.step_response import step_response

step_figure = partial(step_response, variable="p_mc", set_point="p_ref")


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_same_figure_gives_the_same_bytes(recording: xr.Dataset, kind: str) -> None:
    figure = step_figure(recording)
    first = figure_bytes(figure, kind)
    assert figure_bytes(figure, kind) == first
    assert figure_bytes(step_figure(recording), kind) == first


def test_a_figure_is_drawn_once_for_both_formats_and_again_when_it_is_changed(
    recording: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = Mock(side_effect=Figure.draw)
    monkeypatch.setattr(Figure, "draw", lambda *args: draw(*args))
    figure = step_figure(recording)
    first = figure_bytes(figure, "png")
    assert b"changed" not in figure_bytes(figure, "svg")
    assert draw.call_count == 1
    figure.axes[0].set_xlabel("changed")
    assert b">changed</text>" in figure_bytes(figure, "svg")
    assert figure_bytes(figure, "png") != first
    assert draw.call_count == 2


def test_both_formats_have_the_size_of_the_figure(recording: xr.Dataset) -> None:
    figure = step_figure(recording)
    width, height = figure.get_size_inches()
    resolution = figure.dpi
    png, svg = (figure_bytes(figure, kind) for kind in ("png", "svg"))
    assert struct.unpack(">II", png[16:24]) == (int(160 * width), int(160 * height))
    pixels = png_pixels(io.BytesIO(png))
    assert pixels.shape == (int(160 * height), int(160 * width), 3)
    assert pixels.min() < 0.2
    assert pixels[0, 0].tolist() == [1.0, 1.0, 1.0]
    assert f'width="{72 * width:g}pt" height="{72 * height:g}pt"'.encode() in svg
    assert figure.dpi == resolution


def test_order_of_formats_does_not_matter(recording: xr.Dataset) -> None:
    figure = step_figure(recording)
    figure_bytes(figure, "png")
    assert figure_bytes(figure, "svg") == figure_bytes(step_figure(recording), "svg")


@pytest.mark.parametrize(("name", "start"), [("a.png", b"\x89PNG"), ("a.SVG", b"<?xml")])
def test_figures_are_written_by_their_ending(
    recording: xr.Dataset, tmp_path: Path, name: str, start: bytes
) -> None:
    path = save_figure(step_figure(recording), tmp_path / "made" / name)
    assert path.read_bytes().startswith(start)
    assert [entry.name for entry in path.parent.iterdir()] == [name]


def test_another_ending_is_refused(recording: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.png or \.svg"):
        save_figure(step_figure(recording), tmp_path / "a.bmp")


def test_the_old_file_stays_when_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bytes(tmp_path / "report.html", b"old")

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(FileError, match="No space left on device"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(FileError, match=r"cannot write .*report"):
        write_bytes(tmp_path / "file" / "report.html", b"")
    with pytest.raises(FileError, match="cannot write"):
        write_bytes(tmp_path, b"")


def test_a_written_file_has_the_usual_permissions(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_bytes(b"")
    assert write_bytes(tmp_path / "ours", b"").stat().st_mode == plain.stat().st_mode
