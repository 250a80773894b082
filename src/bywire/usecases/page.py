"""Export of a bench as one page that anyone can open."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.core.errors import not_valid
from bywire.usecases.asks import BenchName, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.exports import BenchPage

PageFile = Annotated[str | Path, Ask("HTML file to write (.html).", is_flag=True)]
Sliders = Annotated[
    Sequence[str],
    Ask(
        "Parameter to show at the top of the page. Repeatable.",
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
    """Write a bench as one interactive HTML file that updates its curves as you move parameters.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        File of the page (.html). An existing file is overwritten.
    overrides
        Changes to a bench file or experiment, in the form of ``--set``.
    vary
        Parameters at the top of the page. Default: those that the bench changes, otherwise those
        that its brake declares (`bywire.authoring.Sliders`).
    case
        Run of the experiment that the page computes. Optional if there is only one.

    Returns
    -------
    BenchPage
        The file and its size.

    Raises
    ------
    InputError
        If the bench cannot be exported, the file cannot be written, or a name in ``vary`` is not
        a numeric parameter of the bench or has no effect.
    CompilerError
        If the extra ``compiler`` is not installed.
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
        raise not_valid("out", repr(str(out)), "a file that ends in .html")
    bench = bench_of(bench, overrides)
    made = exported(bench, case)
    _, reads = start_source(made)
    used = [each.name for each in interface(made, "brake", reads).of("parameter")]
    for name in vary:
        if name not in leaf_fields(type(bench.par)):
            raise unknown_name("parameter", name, used)
        if name not in used:
            raise ParameterError(
                f"{name} has no effect in this bench. Remove it from vary", name=name
            )
    result = run(bench)
    panels = shown_panels(result.recordings[made.case.label])
    content = page_text(made, panels, result, vary).encode()
    file = write_bytes(out, content)
    return BenchPage(file, made, len(content), len(gzip.compress(content, mtime=0)))
