"""The page inside an FMU: what it is, how it steps, what it takes and gives."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from bywire.core.units import shown
from bywire.core.version import __version__
from bywire.export.exported import Exported
from bywire.export.interface import Interface

_STEPS = {
    2: "A step first does the ticks of the ECU that are due at its beginning, with the inputs as "
    "they were set, then the substeps. Between steps a client gets the state right before the "
    "ticks that are due then (left limits): what the ECU holds is that of its last tick.",
    3: "Without event mode, a step first does the ticks of the ECU that are due at its beginning, "
    "with the inputs as they were set, then the substeps; between steps a client gets the state "
    "right before the ticks that are due then. With event mode, ticks are done there, when "
    "their clocks tick, and results after them are those that a bench records.",
}
_EXCHANGED = (
    "A client's solver integrates the states. Bodies with dry friction are stuck or slide, states "
    "with limits are free or at them, contacts press or are open: these modes (mode.*) change in "
    "event mode alone, where an event indicator has changed its sign or inputs have. What the ECU "
    "holds are inputs; set them in event mode. Energies and other integrals are not in this unit."
)


def documentation(made: Exported, faces: Interface, begins_anywhere: bool, version: int) -> str:
    """Return the page, HTML without anything from elsewhere."""
    bench, par, schedule = made.bench, made.run.par, made.schedule
    title = escape(f"{bench.name or bench.experiment}: {faces.part}")
    begins = (
        "Changed parameters begin at rest too."
        if begins_anywhere
        else "The start is that of the exported parameters: with others, the brake begins off its "
        "equilibrium and settles."
    )
    tasks = ", ".join(
        f"{task.name} every {shown(task.period, 's')}" for task in made.run.model.tasks(par)
    )
    is_exchanged = faces.kind == "model-exchange"
    facts = [
        ("Model", made.run.model.name),
        ("Experiment", f"{bench.experiment}, run {made.case.label!r}: {bench.summary()}"),
        ("Parameter set", bench.parameters),
        ("Time 0", f"{shown(made.case.settle, 's')} before time zero of the bench's recording"),
        *(
            ()
            if is_exchanged
            else (
                ("Internal step", f"{shown(schedule.step, 's')}, fixed"),
                (
                    "Communication step",
                    f"whole multiples of {shown(schedule.frame, 's')}; others are refused",
                ),
                ("Tasks", tasks),
            )
        ),
        ("Structure", ", ".join(f"{k} = {v}" for k, v in par.choices().items())),
    ]
    texts = [
        _EXCHANGED if is_exchanged else _STEPS[version],
        f"{begins} Values that are no numbers or out of their range are refused, and those before "
        "stay. Noise of sensors is an input: a standard normal number for each tick, or zero.",
        "reference.csv, beside this page, is the bench's own run: time, stimulus, and every "
        "recorded signal after the ticks, in SI units. Warnings that the bench gives of ranges of "
        "validity are not in this unit.",
    ]
    rows = [
        (
            v.name,
            v.causality,
            v.unit,
            "" if v.start is None else f"{v.start:.6g}",
            "" if v.leaf is None else v.leaf.range_text,
            v.label,
        )
        for v in faces.variables
        if v.causality != "local" or is_exchanged
    ]
    heading = ("name", "what", "unit", "start", "range", "meaning")
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body {{ font: 15px sans-serif; margin: 2em auto; max-width: 70em }}
td, th {{ text-align: left; padding: 0.1em 1em 0.1em 0; vertical-align: top }}</style></head>
<body><h1>{title}</h1>
<p>Made by bywire {escape(__version__)}. All values in SI units.</p>
<table>{_rows(facts)}</table>
{"".join(f"<p>{escape(each)}</p>" for each in texts)}
<h2>Variables</h2>
<table><tr>{"".join(f"<th>{each}</th>" for each in heading)}</tr>{_rows(rows)}</table>
</body></html>
"""


def _rows(rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
