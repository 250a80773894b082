"""The bench that a measurement is laid beside, and what is asked of it; texts as typed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.core.errors import ParameterError

if TYPE_CHECKING:
    from bywire.bench.bench import Bench
    from bywire.data.file_format import Progress
    from bywire.identification.fitting.asked import Asked, BenchMethod
    from bywire.identification.method import Method


@dataclass(frozen=True)
class OnBench:
    """What a method of any bench needs beside measurements."""

    bench: Path | None
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    unknowns: Mapping[str, str]
    priors: Mapping[str, str]
    states: Sequence[str]
    case: str
    holdout: Path | None
    loss: str = ""

    @property
    def given(self) -> tuple[str, ...]:
        """Options that were given."""
        options = {
            "--bench": self.bench, "--input": self.inputs, "--output": self.outputs,
            "--unknown": self.unknowns, "--prior": self.priors, "--estimate-start": self.states,
            "--case": self.case, "--holdout": self.holdout,
            "--loss": self.loss,
        }  # fmt: skip
        return tuple(name for name, value in options.items() if value)


def read_bench(path: Path, changes: Mapping[str, str]) -> Bench:
    """Return the bench; one that wants a stimulus gets none of its own, for it is measured."""
    from bywire.bench.bench_file import read

    try:
        return read(path, changes)
    except ParameterError as error:
        if "[stimulus]" not in str(error):
            raise
    silent = {"kind": "step", "start": "0", "end": "0", "t_step": "0"}
    return read(path, {**{f"stimulus.{k}": v for k, v in silent.items()}, **changes})


def method_on_bench(
    found: BenchMethod,
    wanted: OnBench,
    changes: Mapping[str, str],
    mapping: Path | None,
    progress: Progress,
) -> Method:
    """Return a method of any bench for the one that is wanted.

    Parameters
    ----------
    changes
        Of the bench, as ``--set`` gives them.
    mapping
        What the columns of measured files mean.
    progress
        Called with a label and the finished share.

    Raises
    ------
    InputError
        When something does not fit.
    """
    if wanted.bench is None:
        raise ParameterError(
            f"{found.name} needs --bench: a bench file (TOML), or an experiment of 'bywire list'"
        )
    bench, asked = read_bench(wanted.bench, changes), _asked(wanted)
    method = found.on(bench, asked)
    if wanted.holdout is None:
        return method
    from bywire.identification.measured import measured

    held = measured(
        [wanted.holdout], mapping, method.signals, optional=method.optional, gaps=True,
        multiple=bench.step, progress=progress,
    )  # fmt: skip
    return found.on(bench, replace(asked, holdout=held.data))


def _asked(wanted: OnBench) -> Asked:
    from bywire.identification.fitting.asked import Asked

    return Asked(
        wanted.inputs, wanted.outputs, wanted.unknowns, wanted.priors, tuple(wanted.states),
        wanted.case,
    )  # fmt: skip
