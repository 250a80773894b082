"""A page for each kind of thing in the registry, with the text of ``bywire list NAME``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bywire.analysis.loop import LOOPS, PLANTS
from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.api.describe import Description, described
from bywire.api.things import all_things
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
    """A page for one or several kinds of things.

    Parameters
    ----------
    title, about
        Heading, and the sentence below it.
    names
        Kind of thing, as `bywire.describe` calls it -> a function that returns all names.
    """

    title: str
    about: str
    names: dict[str, Callable[[], Iterable[str]]]


TOPICS = {
    "assemblies": Topic(
        "Brakes and their assemblies",
        "All models that bywire can simulate, with their recorded signals.",
        {"assembly": lambda: ASSEMBLIES.all()},
    ),
    "parameter-sets": Topic(
        "Parameter sets",
        "Every value states its source: a paper, a derivation, a calibration or a choice.",
        {"parameter set": lambda: PARAMETER_SETS.all()},
    ),
    "experiments": Topic(
        "Experiments",
        "Names for the key `experiment` of a bench file, with options and key figures.",
        {
            "experiment": lambda: EXPERIMENTS.all(),
            "experiment of any brake": lambda: GENERIC_EXPERIMENTS.all(),
        },
    ),
    "stimuli": Topic(
        "Stimuli",
        "Inputs of an experiment over time, for `[stimulus]` of a bench file.",
        {"stimulus": lambda: STIMULI.all()},
    ),
    "key-figures": Topic(
        "Key figures",
        "The definition of each key figure.",
        {"KPI": lambda: definitions()},
    ),
    "loops": Topic(
        "Loops and plants",
        "Names for `linearize`, `margins`, `frequency-response`, `agreement` and `design`.",
        {"loop": lambda: LOOPS.all(), "plant": lambda: PLANTS.all()},
    ),
    "methods": Topic(
        "Methods of identification",
        "Names for `identify`.",
        {"method": lambda: METHODS.all(), "method of any bench": lambda: BENCH_METHODS.all()},
    ),
    "studies": Topic(
        "Studies and lives",
        "Names for `study size` and `life`.",
        {"study": lambda: STUDIES.all(), "life": lambda: LIVES.all()},
    ),
    "campaigns": Topic(
        "Campaigns of faults",
        "Names for `faults`.",
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
    """Return the page of all faults, one per line: most differ only by their signal."""
    lines = [
        "# Faults",
        "",
        "Names for `[[faults]]` of a bench file and for `--fault`. `bywire list NAME` shows all "
        "about one fault.",
        "",
    ]
    rows = ([f"`{name}`", plain(summary)] for name, summary in all_things()["faults"].items())
    return "\n".join([*lines, *table_lines(["fault", "effect"], rows)])


def loop_figures_page() -> str:
    """Return the page of the figures of loops, one per line."""
    lines = [
        "# Figures of loops",
        "",
        "Figures that `--require` of `bywire design`, or a file of requirements, can limit, by "
        "either name. `bywire margins --json` reports figures with a second name under that name.",
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
    """Return the page of the brakes that come with bywire, with schematics of their models."""
    rows = ([f"`{brake.name}`", plain(brake.summary)] for brake in brakes().values())
    lines = ["# Brakes", "", *table_lines(["brake", "description"], rows)]
    main = {cited.assembly: name for name, cited in reversed(PARAMETER_SETS.all().items())}
    for brake in brakes().values():
        lines += [f"## {plain(brake.name)}", "", plain(brake.summary), ""]
        for name, model in ASSEMBLIES.all().items():
            if model.__module__.startswith(f"{brake.module}.") and name in main:
                par = PARAMETER_SETS.find(main[name]).parameters()
                lines += [f"### {plain(name)}", "", *block_lines(schematic_blocks(model(), par))]
    return "\n".join(lines)
