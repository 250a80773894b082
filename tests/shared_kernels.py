"""What one process of a test run prepares serves the others: no model is evaluated twice."""

from __future__ import annotations

from dataclasses import replace

from bywire.core.model import Model
from bywire.simulation import engine, kept_kernel


def share_kernels(run: str) -> None:
    """Keep kernels of our models for the processes of a test run, whose name is their state.

    Not as commands keep them, whose entries stay apart: a test may put a function of its own in the
    place of ours. One that does so gives the models that it prepares a place of their own too
    (``engine._PREPARED``), and nothing of them is kept.
    """
    prepared, state = engine._PREPARED, kept_kernel._running_state

    def of_this_run() -> str:
        return run if engine._PREPARED is prepared else state()

    def place_of(model: Model, structure: tuple[object, ...]) -> kept_kernel.Place | None:
        place = kept_kernel.place_of(model, structure)
        if place is None or place.state != run:
            return place
        return replace(place, file=place.file.with_name(f"tests-{place.file.name}"))

    kept_kernel._running_state = of_this_run
    engine.place_of = place_of
