"""What the design of a study admits: probabilities, correlations, and how many cases."""

from __future__ import annotations

from bywire.core.errors import ParameterError
from bywire.studies.plan import StudyPlan
from bywire.studies.points import SAMPLED
from bywire.studies.sensitivity_design import LEVELS, MORRIS, SENSITIVITY
from bywire.studies.sought_design import IMPORTANCE, RARE, SUBSET, SoughtDesign

_DEPENDENT = "has cases that share values and are not independent"


def require_agreement(plan: StudyPlan) -> None:
    """Refuse probabilities and correlations of designs without independent cases.

    Raises
    ------
    ParameterError
        For these, and for a number of cases that the design does not admit.
    """
    if plan.is_sampled:
        return
    if plan.sought is not None and plan.design in RARE:
        _require_rare(plan, plan.sought)
        return
    is_indexed = plan.design in SENSITIVITY
    others = ", ".join(map(repr, SAMPLED))
    if plan.correlations:
        why = (
            "exchanges each quantity for itself, so that none may depend on another"
            if is_indexed
            else "goes to the ends of each quantity for itself"
        )
        raise ParameterError(
            f"[[correlation]]: {plan.design!r} {why}: leave it out, or take {others}"
        )
    if plan.design == MORRIS:
        for each in plan.varied:
            if (count := len(each.distribution.singles)) > LEVELS:
                raise ParameterError(
                    f"[vary] {each.name} has {count} values, and {plan.design!r} steps on {LEVELS} "
                    f"levels: some would never be taken; name {LEVELS} of them, or take "
                    "'sobol-indices'"
                )
    for demand in plan.demands:
        if demand.probability is not None:
            why = _DEPENDENT if plan.design == "sobol-indices" else "draws nothing"
            raise ParameterError(
                f"requirement {str(demand)!r}: {plan.design!r} {why}, so that its cases "
                f"have no probability: take {others}, or leave 'with ...' out: every case then has "
                "to meet the limit"
            )
    if plan.sought is not None:
        if not plan.demands:
            raise ParameterError(
                f"[requirements]: {plan.design!r} searches for the worst case of each, and there "
                'is none: write for instance overshoot = "<= 15 %"'
            )
        plan.sought.require_budget()
        return
    plan.points  # noqa: B018 - refuses what is too large, or too small for indices


def _require_rare(plan: StudyPlan, design: SoughtDesign) -> None:
    """Refuse rare failures of nothing, and the search of a design point among single values."""
    if not plan.judged_demands:
        raise ParameterError(
            f"[requirements]: {plan.design!r} asks how probable it is that one is missed, and none "
            'has a probability: write for instance "<= 15 % with 99.99 %"'
        )
    singles = [each.name for each in plan.varied if each.distribution.is_discrete]
    if singles and plan.design == IMPORTANCE:
        raise ParameterError(
            f"[vary] {', '.join(singles)}: {plan.design!r} follows derivatives, and single values "
            f"have none: take {SUBSET!r}"
        )
    design.require_budget()
