"""What stands above the key figures of a run: how far they can be read as those of the brake."""

from __future__ import annotations

import math

from bywire.bench.bench import Bench
from bywire.bench.experiment import Recordings
from bywire.bench.kpis.registry import FAMILIES
from bywire.bench.result import Result
from bywire.core.model import ASSEMBLIES
from bywire.report.wording import amount

_MOST = {"share_stuck": 0.5, "share_sat_current": 0.1, "share_sat_duty": 0.1}
_MISSED = 0.05  # of the step's height


def remarks(result: Result) -> list[str]:
    """Return what a run did instead of what was asked.

    A run is remarkable that is stuck more than half of its time, at a limit more than a tenth of
    it, or that ends off its set point by more than a twentieth of the step; what its model says is.
    """
    faults = fault_texts(result.bench, result.recordings)
    return [*faults, *_shares(result), *_set_point(result), *_of_models(result)]


def fault_texts(bench: Bench, recordings: Recordings | None = None) -> list[str]:
    """Return each fault of a bench in a sentence: how much, when, what it is.

    ``recordings``: its runs, of which none may meet the fault; None where they are not looked at.
    """
    texts = []
    for fault in bench.injections:
        mode, course = fault.mode, fault.course
        size = f" = {amount(fault.value, mode.unit)}" if mode.unit else ""
        until = f" to {amount(course.end, 's')}" if math.isfinite(course.end) else " on"
        is_met = recordings is None or any(
            course.is_there(each["time"].values).any()
            for each in recordings.values()
            if "time" in each
        )
        unmet = "" if is_met else "; no recorded row meets it"
        texts.append(
            f"fault {mode.name}{size}, from {amount(course.onset, 's')}{until}: "
            f"{mode.summary}{unmet}"
        )
    return texts


def _of_models(result: Result) -> list[str]:
    """Return what the models say of their runs; the same of several of them once.

    Not of recordings that hold other things than the model's signals.
    """
    texts: dict[str, None] = {}
    models = ASSEMBLIES.beside(type(result.bench.par))
    for recording in result.recordings.values():
        model = models.get(str(recording.attrs.get("model")))
        text = recording.attrs.get("parameters")
        if model is None or text is None or not recording.sizes.get("time"):
            continue
        if all(name in recording for name in model.Output._fields):
            par = type(result.bench.par).model_validate_json(text)
            texts |= dict.fromkeys(model().remarks(recording, par))
    return list(texts)


def _shares(result: Result) -> list[str]:
    measures = FAMILIES.find("occupation").measures
    texts = []
    for kpi in result.kpis:
        name = next((each for each in measures if kpi.name.startswith(each)), "")
        if name and kpi.value > _MOST[name]:  # NaN is not
            what = measures[name].definition.rpartition(" which ")[2].rstrip(".")
            where = kpi.name.removeprefix(name).strip("_")
            texts.append(f"{what} {100 * kpi.value:.3g} % of the time{where and f' ({where})'}")
    return texts


def _set_point(result: Result) -> list[str]:
    definition, kpis = result.bench.definition, {kpi.name: kpi for kpi in result.kpis}
    error = kpis.get("steady_state_error")
    if definition.step is None or error is None or math.isnan(error.value):
        return []
    step = definition.step(result.bench.chosen_options)
    if step.start is None or step.end is None or step.start == step.end:
        return []
    share = error.value / abs(step.end - step.start)
    if not share > _MISSED:
        return []
    return [
        f"misses its set point: {step.signal} ends {amount(error.value, error.unit)} off "
        f"{amount(step.end, error.unit)}, {100 * share:.3g} % of the step"
    ]
