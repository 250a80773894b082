"""A bench as one page that anybody can open."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchName, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.exports import BenchPage

PageFile = Annotated[str | Path, Ask("File of the page (.html).", is_flag=True)]
Sliders = Annotated[
    Sequence[str],
    Ask(
        "Parameter that stands first in the page; may be given several times.",
        completes="parameters",
    ),
]


@use_case(
    Command("page", writes=""),
    form=Form(
        "Live page", "Make the page", fields=("bench", "case"), is_listed=False, is_file=True
    ),
)
def page(
    bench: BenchName,
    out: PageFile,
    overrides: LastBenchChanges = NOTHING,
    *,
    vary: Sliders = (),
    case: NeededCase = "",
) -> "BenchPage":
    """Write a bench as one HTML file that computes it: parameters to move, curves that follow.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        File of the page (.html); one that is there is replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    vary
        Parameters that stand first in the page; by default those that the bench changes,
        else those that its brake declares (`bywire.authoring.Sliders`).
    case
        Which run of the experiment it computes; may be left out where there is but one.

    Returns
    -------
    BenchPage
        The file and its size.

    Raises
    ------
    InputError
        When the bench cannot be exported, for a name in ``vary`` that is no number of the bench or
        has no effect in it, and when the file cannot be written.
    CompilerError
        Without the extra ``compiler``.
    """
    import gzip

    from bywire.api.exports import BenchPage
    from bywire.api.run import bench_of
    from bywire.bench.running import run
    from bywire.core.errors import ParameterError, unknown_name
    from bywire.core.parameters import leaf_fields
    from bywire.export.exported import exported, interface, start_source
    from bywire.report.drawing import write_bytes
    from bywire.report.live_page.content import page_text
    from bywire.report.time_traces import shown_panels

    if Path(out).suffix.lower() not in (".html", ".htm"):
        raise ParameterError(f"out = {str(out)!r} is no page: give a file that ends in .html")
    bench = bench_of(bench, overrides)
    made = exported(bench, case)
    _, reads = start_source(made)
    used = [each.name for each in interface(made, "brake", reads).of("parameter")]
    for name in vary:
        if name not in leaf_fields(type(bench.par)):
            raise unknown_name("parameter", name, used)
        if name not in used:
            raise ParameterError(f"{name} has no effect in this bench: leave it out of vary")
    result = run(bench)
    panels = shown_panels(result.recordings[made.case.label])
    content = page_text(made, panels, result, vary).encode()
    file = write_bytes(out, content)
    return BenchPage(file, made, len(content), len(gzip.compress(content, mtime=0)))
