"""What a page says of a bench before anything is computed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bywire.bench import bench_file
from bywire.core.errors import InputError
from bywire.server.field import is_file_name
from bywire.server.live_pages import experiments


@dataclass(frozen=True)
class ShownBench:
    """A bench, as its page shows it.

    Parameters
    ----------
    name
        Its file, or the experiment.
    summary
        What it tests.
    cases
        Its runs.
    trouble
        Why it makes none as it stands.
    """

    name: str
    summary: str
    cases: tuple[str, ...] = ()
    trouble: str = ""


def shown_bench(path: Path, name: str) -> ShownBench:
    """Return what is said of a bench file, or of an experiment with its defaults.

    Raises
    ------
    InputError
        For a bench file that does not fit.
    """
    try:
        bench = bench_file.read(path, {})
    except InputError as error:
        if is_file_name(name):
            raise
        # What drives it is wanted, which a measurement may give.
        return ShownBench(name, experiments()[name], trouble=str(error))
    # By their preview: the runs themselves may begin where others ended, and these take a while.
    cases = bench.cases_with(bench.par, bench.chosen_options, bench.definition.preview)
    summary = f"{bench.summary()}; parameters {bench.parameters}"
    return ShownBench(name, summary, tuple(case.label for case in cases))
