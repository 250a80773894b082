"""Figures drawn in forked processes: the files are the same in any process."""

from __future__ import annotations

import os
import sys
from functools import partial

import pytest
from matplotlib.figure import Figure

from bywire.core.copies import processes
from bywire.report import drawing
from bywire.report.document import FigureBlock, Picture
from bywire.report.drawing import FEW, drawn_side_by_side, figure_bytes, inline_figures

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="copies are of Linux alone"),
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]  # the test process has threads; commands that fork have none


def line(k: int) -> Figure:
    figure = Figure((1.5, 1.0))
    figure.subplots().plot([0.0, 1.0], [k, 2.0])
    return figure


def blocks(count: int) -> list[FigureBlock]:
    return [FigureBlock(partial(line, k), f"figure {k}") for k in range(count)]


@pytest.fixture(autouse=True)
def copied(monkeypatch):
    monkeypatch.setattr(drawing, "may_copy", lambda: True)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)


def test_copies_draw_the_same():
    many, alone = blocks(FEW + 1), blocks(FEW + 1)
    with drawn_side_by_side(many):
        pass
    assert all(isinstance(block.figure, Picture) for block in many)
    shown, wanted = ([(b.figure, b.caption) for b in each] for each in (many, alone))
    assert inline_figures(shown) == inline_figures(wanted)
    assert inline_figures(shown, budget=0) == inline_figures(wanted, budget=0)
    for (ours, _), (theirs, _) in zip(shown, wanted, strict=True):
        assert [figure_bytes(ours, k) for k in ("png", "svg")] == [
            figure_bytes(theirs, k) for k in ("png", "svg")
        ]
    assert len({figure_bytes(figure) for figure, _ in shown}) == len(many)


def test_what_is_long_is_begun_first(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 9)
    monkeypatch.setattr(
        drawing, "processes", lambda _, *rest, **is_copied: processes(1, *rest, **is_copied)
    )
    begun = tmp_path / "begun"

    def noted(k: int) -> Figure:
        with begun.open("a") as stream:
            stream.write(f"{k} ")
        return line(k)

    many = [FigureBlock(partial(noted, k), f"figure {k}", is_long=k in (1, 4)) for k in range(5)]
    with drawn_side_by_side(many):
        pass
    assert begun.read_text() == "1 4 0 2 3 "
    (alone, shown) = (inline_figures([(f, "")]) for f in (line(3), many[3].figure))
    assert alone == shown


def test_few_figures_are_not_worth_copies():
    few = blocks(FEW)
    with drawn_side_by_side(few):
        pass
    assert not any("figure" in vars(block) for block in few)


def test_a_figure_that_fails_says_why():
    def broken() -> Figure:
        raise ValueError("no such line")

    with (
        pytest.raises(ValueError, match="no such line"),
        drawn_side_by_side([*blocks(FEW), FigureBlock(broken, "broken")]),
    ):
        pass


def test_a_copy_that_is_killed_leaves_its_figures_to_be_drawn_here(monkeypatch):
    maker = os.getpid()

    def killed() -> Figure:
        if os.getpid() != maker:
            os._exit(9)
        return line(0)

    many = [*blocks(FEW), FigureBlock(killed, "killed")]
    with drawn_side_by_side(many):
        pass
    assert isinstance(many[-1].figure, Figure)
