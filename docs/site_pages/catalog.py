"""A page for each kind of object in the registry, with the text of ``bywire list NAME``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

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
    """A page for one or several kinds of objects.

    Parameters
    ----------
    title, about
        Heading, and the sentence below it.
    names
        Kind of object, as `bywire.describe` calls it -> a function that returns all names.
    are_apart
        Whether each object has its own page.
    command
        Function that returns the lines below each description, with a marked block.
    """

    title: str
    about: str
    names: dict[str, Callable[[], Iterable[str]]]
    are_apart: bool = False
    command: Callable[[dict[str, Any]], list[str]] | None = None


_PRESSURE = "parameters=dardanelli2010 options.input=p_set"
_SINE = f"{_PRESSURE} stimulus.kind=sine stimulus.mean=20bar stimulus.amplitude=5bar stimulus.f=2Hz"
_SETTINGS = {  # of experiments that do not have a default for everything
    "motor-open-loop": "stimulus.kind=step stimulus.start=0A stimulus.end=2A stimulus.t_step=0.1s",
    "duty": "parameters=roberts2003 options.input=M_set motor_heat.law=lumped",
    "open-loop": _SINE,
    "tracking": _SINE,
    "ramp": f"{_PRESSURE} options.end=30bar options.slope=10bar/s",
    "release": f"{_PRESSURE} options.start=30bar",
    "sine-sweep": f"{_PRESSURE} options.mean=20bar options.amplitude=1bar",
    "step": f"{_PRESSURE} options.end=30bar",
    "stribeck": "parameters=dardanelli2010 options.friction=omega",
}


def _experiment(thing: dict[str, Any]) -> list[str]:
    name = thing["name"]
    settings = "".join(f" --set {each}" for each in _SETTINGS.get(name, "").split())
    return ["```sh run *", f"bywire run {name}{settings} --out results/{name}", "```", ""]


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
        are_apart=True,
    ),
    "experiments": Topic(
        "Experiments",
        "Names for the key `experiment` in a bench file, with options and key figures.",
        {
            "experiment": lambda: EXPERIMENTS.all(),
            "generic experiment": lambda: GENERIC_EXPERIMENTS.all(),
        },
        are_apart=True,
        command=_experiment,
    ),
    "stimuli": Topic(
        "Stimuli",
        "Inputs of an experiment over time, for the section `[stimulus]` of a bench file.",
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
        "Identification methods",
        "Names for `identify`.",
        {"method": lambda: METHODS.all(), "method of any bench": lambda: BENCH_METHODS.all()},
    ),
    "studies": Topic(
        "Sizing studies and life projections",
        "Names for `study size` and `life`.",
        {"study": lambda: STUDIES.all(), "life": lambda: LIVES.all()},
    ),
    "campaigns": Topic(
        "Fault campaigns",
        "Names for `faults`.",
        {"campaign": lambda: CAMPAIGNS.all()},
    ),
}


def texts() -> Iterator[tuple[str, str]]:
    """Yield file and text of the pages of all topics."""
    for name, topic in TOPICS.items():
        objects = [
            described_as(kind, thing) for kind, names in topic.names.items() for thing in names()
        ]
        lines = [f"# {topic.title}", "", topic.about, ""]
        if not topic.are_apart:
            sections = (line for each in objects for line in _lines(each, 2))
            yield f"{name}.md", "\n".join([*lines, *sections])
            continue
        for each in objects:
            command = topic.command(each) if topic.command else []
            yield f"{name}/{each['name']}.md", "\n".join([*_lines(each, 1), *command])
        rows = ([f"[{plain(e['name'])}]({e['name']}.md)", plain(e["summary"])] for e in objects)
        toctree = ["```{toctree}", ":hidden:", "", *(e["name"] for e in objects), "```", ""]
        yield f"{name}/index.md", "\n".join([*lines, *table_lines(["name", ""], rows), *toctree])


def described_as(kind: str, name: str) -> dict[str, Any]:
    """Return the description of a name as a kind of object."""
    return next(each for each in described(name) if each["kind"] == kind)


def _lines(thing: dict[str, Any], level: int) -> list[str]:
    return section_lines(Description(thing["name"], (thing,)).document().page, level)


def faults_page() -> str:
    """Return the page of all faults, one per line, because most differ only by their signal."""
    lines = [
        "# Faults",
        "",
        "Names for `[[faults]]` in a bench file and for `--fault`. `bywire list NAME` shows the "
        "details of a fault.",
        "",
    ]
    rows = ([f"`{name}`", plain(summary)] for name, summary in all_things()["faults"].items())
    return "\n".join([*lines, *table_lines(["fault", "effect"], rows)])


def loop_figures_page() -> str:
    """Return the page of all loop figures, one per line."""
    lines = [
        "# Loop figures",
        "",
        "`bywire design --require`, or a file with requirements, can set limits for these figures. "
        "If a figure has a second name, `bywire margins --json` uses it, and requirements accept "
        "both names.",
        "",
    ]
    rows = (
        [
            f"`{figure.name}`",
            f"`{figure.margin}`" if figure.margin else "",
            "" if figure.unit == "1" else figure.unit,
            "lower" if figure.is_less_better else "higher",
            plain(figure.meaning),
        ]
        for figure in LOOP_FIGURES.values()
    )
    headings = ["figure", "in `margins`", "unit", "better", "meaning"]
    return "\n".join([*lines, *table_lines(headings, rows)])


def brakes_page() -> str:
    """Return the page of the included brakes, with schematics of their models."""
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
