"""What the registry finds, a page for each kind of thing: all that ``bywire list NAME`` says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bywire.analysis.loop import LOOPS, PLANTS
from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.api.describe import Description, described
from bywire.api.described import fault_summaries
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.families import definitions
from bywire.bench.stimulus import STIMULI
from bywire.campaigns.residual import CAMPAIGNS
from bywire.core.brake import brakes
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from bywire.identification.method import METHODS
from bywire.identification.question import BENCH_METHODS
from bywire.life.declaration import LIVES
from bywire.report.schematic import schematic_blocks
from bywire.synthesis.study import STUDIES
from site_pages.markdown import block_lines, plain, section_lines, table_lines


@dataclass(frozen=True)
class Topic:
    """A page of things.

    Parameters
    ----------
    title, about
        Heading, and what stands below it.
    names
        Kind of thing, as `bywire.describe` calls it -> what returns the names of all.
    """

    title: str
    about: str
    names: dict[str, Callable[[], Iterable[str]]]


TOPICS = {
    "assemblies": Topic(
        "Brakes and their assemblies",
        "What can be simulated, with the signals that a recording holds.",
        {"assembly": lambda: ASSEMBLIES.all()},
    ),
    "parameter-sets": Topic(
        "Parameter sets",
        "Every value says where it comes from: a source, a derivation, a calibration, a choice.",
        {"parameter set": lambda: PARAMETER_SETS.all()},
    ),
    "experiments": Topic(
        "Experiments",
        "What a bench file's `experiment` names, with options and key figures.",
        {
            "experiment": lambda: EXPERIMENTS.all(),
            "experiment of any brake": lambda: GENERIC_EXPERIMENTS.all(),
        },
    ),
    "stimuli": Topic(
        "Stimuli",
        "What a bench drives an experiment with.",
        {"stimulus": lambda: STIMULI.all()},
    ),
    "key-figures": Topic(
        "Key figures",
        "How each is computed.",
        {"KPI": lambda: definitions()},
    ),
    "loops": Topic(
        "Loops and plants",
        "What `linearize`, `margins`, `frequency-response` and `design` take.",
        {"loop": lambda: LOOPS.all(), "plant": lambda: PLANTS.all()},
    ),
    "methods": Topic(
        "Methods of identification",
        "What `identify` takes.",
        {"method": lambda: METHODS.all(), "method of any bench": lambda: BENCH_METHODS.all()},
    ),
    "studies": Topic(
        "Studies and lives",
        "What `study size` and `life` take.",
        {"study": lambda: STUDIES.all(), "life": lambda: LIVES.all()},
    ),
    "campaigns": Topic(
        "Campaigns of faults",
        "What `faults` takes.",
        {"campaign": lambda: CAMPAIGNS.all()},
    ),
}


def page(name: str) -> str:
    """Return the page of a topic."""
    topic = TOPICS[name]
    lines = [f"# {topic.title}", "", topic.about, ""]
    for kind, names in topic.names.items():
        for thing in names():
            objects = [each for each in described(thing) if each["kind"] == kind]
            sections = Description(thing, tuple(objects)).document().page
            lines += section_lines(sections, 2)
    return "\n".join(lines)


def faults_page() -> str:
    """Return the page of all faults, a line each: most differ by their signal alone."""
    lines = [
        "# Faults",
        "",
        "What `[[faults]]` of a bench file and `--fault` take; `bywire list NAME` says all about "
        "one.",
        "",
    ]
    rows = ([f"`{name}`", plain(summary)] for name, summary in fault_summaries().items())
    return "\n".join([*lines, *table_lines(["fault", "what happens"], rows)])


def loop_figures_page() -> str:
    """Return the page of the figures of loops, a line each."""
    lines = [
        "# Figures of loops",
        "",
        "What `--require` of `bywire design` and a file of requirements limit, by either name; "
        "`bywire margins --json` gives those that have a second name by it.",
        "",
    ]
    rows = (
        [
            f"`{figure.name}`",
            f"`{figure.margin}`" if figure.margin else "",
            "" if figure.unit == "1" else figure.unit,
            "less" if figure.is_less_better else "more",
            plain(figure.meaning),
        ]
        for figure in LOOP_FIGURES.values()
    )
    headings = ["figure", "in `margins`", "unit", "better", "meaning"]
    return "\n".join([*lines, *table_lines(headings, rows)])


def brakes_page() -> str:
    """Return the page of the brakes that come with bywire, with the schematics of what they run."""
    rows = ([f"`{brake.name}`", plain(brake.summary)] for brake in brakes().values())
    lines = ["# Brakes", "", *table_lines(["brake", "what it is"], rows)]
    main = {cited.assembly: name for name, cited in reversed(PARAMETER_SETS.all().items())}
    for brake in brakes().values():
        lines += [f"## {plain(brake.name)}", "", plain(brake.summary), ""]
        for name, model in ASSEMBLIES.all().items():
            if model.__module__.startswith(f"{brake.module}.") and name in main:
                par = PARAMETER_SETS.find(main[name]).parameters()
                lines += [f"### {plain(name)}", "", *block_lines(schematic_blocks(model(), par))]
    return "\n".join(lines)
