"""Polynomial surrogates of key figures between a study's cases."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import StudyFolder, require_study_folder
from bywire.usecases.declare import NOTHING, Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.study_surrogate import StudySurrogates

KeyFigures = Annotated[
    str | Sequence[str],
    Ask("Key figure to estimate. Default: those with requirements.", name="kpi", metavar="NAME"),
]
Values = Annotated[
    Mapping[str, Any],
    Ask("Value at which to estimate, e.g. motor.R_m=0.4ohm.", metavar="KEY=VALUE"),
]


@use_case(Command("study surrogate", before=require_study_folder, writes=""))
def study_surrogates(
    folder: StudyFolder,
    kpis: KeyFigures = (),
    at: Values = NOTHING,
) -> "StudySurrogates":
    """Estimate key figures between a study's cases with polynomials, including their error.

    Parameters
    ----------
    folder
        Folder of the study.
    kpis
        One or several key figures. Default: those with a requirement, otherwise all.
    at
        Values of varied quantities at which to estimate, as SI numbers, texts with units, or
        changes such as ``"+5 %"`` of the bench's value. All others have the bench's value.

    Returns
    -------
    StudySurrogates
        Each surrogate with its error in the key figure's unit. ``.surrogates["overshoot"]`` is a
        function of values or arrays [SI].

    Raises
    ------
    InputError
        If the folder contains no study or too few cases, a name is unknown, or a value is outside
        the range of the cases or between the values of a discrete quantity. Also if the design does
        not determine values between its points, or structural choices vary.
    """
    from bywire.api.study_run import kept_study
    from bywire.api.study_surrogate import StudySurrogates
    from bywire.api.study_tables import shown_figures
    from bywire.bench.changes import share_of
    from bywire.core.errors import ParameterError, unknown_name
    from bywire.core.values import number
    from bywire.studies.surrogate import Surrogate, require_fittable, surrogate_of

    report = kept_study(folder)
    require_fittable(report.plan)  # before values are read: those of a choice are not numbers
    findings = report.findings
    quantities = {v.name: v for v in report.plan.varied}
    values: dict[str, float] = {}
    for name, text in at.items():
        if name not in quantities:
            raise unknown_name("quantity of the study", name, quantities)
        share = share_of(text)
        change = (1.0 + share) * quantities[name].nominal if share is not None else text
        values[name] = number(change, quantities[name].unit or "1", name)
    surrogates: dict[str, Surrogate] = {}
    refused: dict[str, str] = {}
    wanted = [kpis] if isinstance(kpis, str) else kpis
    required = [each.figure for each in report.plan.demands]
    for kpi in wanted or shown_figures(findings) or required:
        try:
            surrogates[kpi] = surrogate_of(findings, kpi)
        except ParameterError as error:
            refused[kpi] = str(error)
    if not surrogates:
        why = "; ".join(dict.fromkeys(refused.values()))
        raise ParameterError(why or f"{folder}: no case is computed yet", name=str(folder))
    return StudySurrogates(report, surrogates, values, refused)
