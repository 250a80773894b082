"""``bywire agreement``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from bywire.analysis.agreement import EVERYTHING, GAIN, NOTHING, PHASE, Agreement, agreement
from bywire.analysis.response.frequency_response import require_stable
from bywire.api.loop_case import LoopCase, loop_case, spread
from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of
from bywire.report.wording import amount

_POINTS = 6
_WIDTH = 140  # characters of a line


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    frequencies: str,
    amplitudes: str,
    out: Path | None,
    as_json: bool,
) -> int:
    """Compare nonlinear and linear response, cause by cause.

    Returns
    -------
    int
        Exit status: 1 where they do not agree with everything off.
    """
    if out is not None:
        require_folder(out)
    chosen = loop_case(loop, parameters, at, changes)
    own = chosen.loop
    point = own.point(chosen.par, chosen.value)
    unit = signals_of(point.model.Stimulus)[own.inputs[0]].unit
    small, large = _amplitudes(chosen, amplitudes, unit)
    wanted = (
        spread(frequencies, "Hz", "frequencies", logarithmic=True)
        if frequencies
        else [float(f) for f in np.geomspace(*own.band, _POINTS)]
    )
    require_stable(own.closed(chosen.par, chosen.value))
    with progress_bar() as progress:
        found = agreement(
            own, chosen.par, chosen.value, wanted, (small, large), progress=progress
        )  # fmt: skip
    texts = (amount(small, unit, 3), amount(large, unit, 3))
    files = [] if out is None else _written(chosen, texts, found, out)
    if as_json:
        shown = {**_as_object(chosen, (small, large), found), "files": list(map(str, files))}
        output.result(json.dumps(shown))
    else:
        output.result(_text(chosen, texts, found))
    for path in files:
        output.message(f"written: {path}")
    return 0 if found.holds else 1


def _amplitudes(chosen: LoopCase, text: str, unit: str) -> tuple[float, float]:
    """Return the small and the large amplitude [SI]."""
    if not text:
        return chosen.loop.amplitudes[0], chosen.loop.amplitudes[-1]
    sizes = spread(text, unit, "amplitudes")
    if len(sizes) != 2 or not sizes[0] < sizes[1]:
        raise ParameterError(
            f"--amplitudes {text}: two are wanted, the small one first: everything off is "
            "measured with it, every cause with the large one"
        )
    return sizes[0], sizes[1]


def _written(
    chosen: LoopCase, amplitudes: tuple[str, str], found: Agreement, out: Path
) -> list[Path]:
    from bywire.report.agreement_report import write_agreement

    return write_agreement(out, chosen.subject, amplitudes, found)


def _as_object(chosen: LoopCase, sizes: tuple[float, float], found: Agreement) -> dict[str, Any]:
    names = {NOTHING: "nothing", EVERYTHING: "everything"}
    return {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "amplitudes": {"small": sizes[0], "large": sizes[1]},
        "frequency": found.frequencies.tolist(),
        "differences": {
            names.get(cause, cause): {
                "gain_dB": _finite(found.gain[cause]), "phase_deg": _finite(found.phase[cause]),
            }
            for cause in found.gain
        },
        "step": {"gain_dB": found.step_gain.tolist(), "phase_deg": found.step_phase.tolist()},
        "largest": [one or None for one in found.largest],
        "tolerance": {"gain_dB": GAIN, "phase_deg": PHASE},
        "holds": found.holds,
    }  # fmt: skip


def _finite(values: Any) -> list[float | None]:
    """Return numbers with null where there is none: JSON has no such numbers."""
    return [float(one) if math.isfinite(one) else None for one in values]


def _text(chosen: LoopCase, amplitudes: tuple[str, str], found: Agreement) -> str:
    from bywire.report.agreement_report import LEGEND, agreement_table, verdict
    from bywire.report.table_text import table_text

    own = chosen.subject
    small, large = amplitudes
    head = f"closed loop {own.name} of {own.parameters} at {own.point}: nonlinear less linear"
    sizes = f"small amplitude {small}, large amplitude {large}"
    table = table_text(agreement_table(found), _WIDTH)
    return "\n".join([head, sizes, table, fill(LEGEND, 100), verdict(found)])
