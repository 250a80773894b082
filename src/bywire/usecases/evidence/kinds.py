"""Kinds of evidence that a use case computes, and the task for each of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from bywire.analysis.loop import LOOPS
from bywire.api.life import LIFE_FIGURES
from bywire.api.loop_case import LoopCase
from bywire.api.replay import driven_bench
from bywire.api.run import bench_of, faulty
from bywire.api.run_faults import CAMPAIGN_FIGURES
from bywire.api.run_over import range_of_bench
from bywire.bench.bench import Bench
from bywire.bench.computation import bench_identity, functions_digest
from bywire.bench.requirements import Limit
from bywire.campaigns.plan import CampaignPlan
from bywire.contracts.subjects import demands_on
from bywire.core.errors import ParameterError, unknown_of_few
from bywire.core.typing import Progress
from bywire.core.version import __version__
from bywire.identification.replay_fit import read_tolerances
from bywire.life.life_file import LifePlan
from bywire.procedures.procedure_file import ProcedurePlan
from bywire.report.bench_figures import FIGURES
from bywire.signoff.judging import judge_limit
from bywire.signoff.plan import Computed, Task
from bywire.synthesis.linear_case import read as read_loop_limits
from bywire.usecases import use_cases
from bywire.usecases.declare import Argument, UseCase
from bywire.usecases.evidence.entry import (
    Origin,
    digests_of,
    read_figure_limit,
    require_file,
    source_digest,
    there,
    title_of,
    value_of,
)

Asked = Mapping[str, Any]
Identity = Mapping[str, Any]


@dataclass(frozen=True)
class Kind:
    """Kind of evidence that a use case computes.

    Parameters
    ----------
    use_case, subject
        Name of the use case, and of its argument that the key in the file specifies.
    read
        ``read(asked)``: checks the arguments by name and returns the subject, without computing.
    identity
        ``identity(read)``: everything that affects the figures, except the arguments.
    limit
        ``limit(read, text)``: a limit of one of its figures.
    resolved
        Arguments whose effect the identity already includes.
    fixed
        Arguments with fixed values, which a sign-off file cannot specify.
    is_by_source
        Whether the figures also depend on code other than the brake's equations and key figures, so
        that every change to the source code changes the digest.
    is_parallel
        Whether the computation itself uses all cores.
    has_report
        Whether the result has a report.
    """

    use_case: str
    subject: str
    read: Callable[[Asked], Any]
    identity: Callable[[Any], Identity]
    limit: Callable[[Any, str], Limit] | None = None
    resolved: tuple[str, ...] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict)
    is_by_source: bool = False
    is_parallel: bool = False
    has_report: bool = True

    @property
    def case(self) -> UseCase:
        """The use case."""
        return use_cases()[self.use_case]

    @property
    def subject_argument(self) -> Argument:
        """The argument that the key in the file specifies."""
        return next(a for a in self.case.arguments if a.argument == self.subject)

    @property
    def key(self) -> str:
        """Name of the subject among the use case's fields."""
        return self.subject_argument.name

    @cached_property
    def arguments(self) -> dict[str, Argument]:
        """Arguments that a sign-off file can specify, by the names of their flags."""
        left_out = (*_NEVER, *self.fixed, self.key)
        return {each.name: each for each in self.case.arguments if each.name not in left_out}


_NEVER = ("out", "animate")
"""arguments of files that only a single command writes"""


# --- The kinds


def _read_bench(asked: Asked) -> Bench:
    bench = faulty(bench_of(asked["bench"], asked.get("set", {})), asked.get("fault", ()))
    bench.injections  # noqa: B018 - rejects invalid faults
    if over := asked.get("over", ""):
        range_of_bench(bench, over)
    return bench


def _bench_identity(bench: Bench) -> Identity:
    return {**bench_identity(bench), "requirements": dict(bench.requirements)}


def _bench_limit(bench: Bench, text: str) -> Limit:
    return read_figure_limit(text, bench.definition.kpis_with(bench.chosen_options))


def _read_loop(asked: Asked) -> LoopCase:
    case: LoopCase = use_cases()["margins"].read(asked)[0]
    case.loop.point(case.par, case.value)  # rejects an impossible operating point
    return case


def _loop_identity(case: LoopCase) -> Identity:
    return {
        "loop": case.loop.name,
        "computed": _loop_digest(case.loop.name),
        "parameters": case.par.flat(),
        "at": case.value,
        "side": case.loop.side,
    }


@cache
def _loop_digest(name: str) -> str:
    return functions_digest([LOOPS.find(name)], "bywire.analysis", with_equations=True)


def _loop_limit(case: LoopCase, text: str) -> Limit:
    del case
    return read_loop_limits([text])[0]


def _read_campaign(asked: Asked) -> CampaignPlan:
    plan: CampaignPlan = use_cases()["run_faults"].read(asked)
    return plan


def _campaign_limit(plan: CampaignPlan, text: str) -> Limit:
    del plan
    return read_figure_limit(text, {name: unit for name, (unit, _) in CAMPAIGN_FIGURES.items()})


def _read_life(asked: Asked) -> LifePlan:
    plan: LifePlan = use_cases()["project_life"].read(asked)
    return plan


def _life_identity(plan: LifePlan) -> Identity:
    return {
        "stop": bench_identity(plan.bench),
        "life": plan.life.name,
        "computed": functions_digest([plan.life], "bywire.life"),
        "wear": plan.wear.flat(),
        "conditions": plan.conditions.flat(),
        "varied": {v.name: [v.distribution.text, v.together] for v in plan.varied},
        "projection": [plan.stops, plan.seed, plan.share, plan.tolerance, plan.longest],
    }


def _life_limit(plan: LifePlan, text: str) -> Limit:
    del plan
    return read_figure_limit(text, {name: unit for name, (unit, _) in LIFE_FIGURES.items()})


def _read_procedure(asked: Asked) -> ProcedurePlan:
    plan: ProcedurePlan = use_cases()["run_procedure"].read(asked)
    return plan


def _procedure_limit(plan: ProcedurePlan, text: str) -> Limit:
    return read_figure_limit(text, plan.units)


def _read_contracts(asked: Asked) -> str:
    name = str(asked["name"])
    next(demands_on(name, FIGURES.all()), None)  # rejects an unknown name
    return name


def _read_controller(asked: Asked) -> Bench:
    return bench_of(asked["bench"], asked.get("set", {}))


def _read_record(asked: Asked) -> Bench:
    if "bench" not in asked:
        raise ParameterError(
            "[[evidence]] record needs a bench. Add the key bench with a bench file or an "
            "experiment",
            name="bench",
        )
    require_file(asked["measurement"])
    if not asked.get("tolerance"):
        raise ParameterError(
            '[[evidence]] record needs a tolerance, such as tolerance = "p_mc.nrmse <= 5 %"',
            name="tolerance",
        )
    read_tolerances(asked["tolerance"])
    return driven_bench(asked["bench"], asked.get("set", {}))


def _read_identification(asked: Asked) -> Identity:
    for each in asked.get("measurements", ()):
        require_file(each)
    return {"method": asked["method"]}


KINDS: Mapping[str, Kind] = {
    "bench": Kind(
        "run", "bench", _read_bench, _bench_identity, _bench_limit, resolved=("set", "fault")
    ),
    "loop": Kind(
        "margins",
        "loop",
        _read_loop,
        _loop_identity,
        _loop_limit,
        resolved=("set", "at", "parameters", "side"),
    ),
    "campaign": Kind(
        "run_faults",
        "campaign",
        _read_campaign,
        lambda plan: plan.identity,
        _campaign_limit,
        resolved=("set",),
        is_parallel=True,
    ),
    "life": Kind(
        "project_life", "source", _read_life, _life_identity, _life_limit, resolved=("set",)
    ),
    "procedure": Kind(
        "run_procedure",
        "procedure",
        _read_procedure,
        lambda plan: plan.identity,
        _procedure_limit,
        resolved=("set",),
    ),
    "contracts": Kind(
        "check", "name", _read_contracts, lambda name: {"of": name}, is_by_source=True
    ),
    "controller": Kind(
        "export_controller",
        "bench",
        _read_controller,
        bench_identity,
        resolved=("set",),
        fixed={"check": True},
        is_by_source=True,
        has_report=False,
    ),
    "record": Kind(
        "replay",
        "measurement",
        _read_record,
        bench_identity,
        resolved=("set", "bench"),
        is_by_source=True,
    ),
    "identification": Kind(
        "identify", "method", _read_identification, lambda asked: asked, is_by_source=True
    ),
}
"""kinds of evidence that use cases compute, by their keys in a sign-off file"""


# --- Their task


@dataclass(frozen=True)
class UseCaseTask(Task):
    """Evidence that a use case computes.

    Parameters
    ----------
    kind, subject, arguments, folder
        Content of the entry, and the folder of the sign-off file.
    asked, read
        The arguments of the use case by name, and what it reads from them.
    """

    kind: str
    subject: str
    arguments: Mapping[str, Any]
    folder: Path
    asked: Mapping[str, Any]
    read: Any

    @property
    def is_parallel(self) -> bool:
        """Whether the use case itself uses all cores."""
        return KINDS[self.kind].is_parallel

    @property
    def origin(self) -> Origin:
        """The reader and its arguments, for another process."""
        return read_kind, (self.kind, self.subject, self.arguments, self.folder)

    @property
    def title(self) -> str:
        """The entry in one line."""
        return title_of(self.kind, self.subject, self.arguments)

    @cached_property
    def identity(self) -> Identity:
        """Everything that affects its figures."""
        kind = KINDS[self.kind]
        by_source = {"source": source_digest(), "files": digests_of(self.asked)}
        return {
            "version": __version__,
            "kind": self.kind,
            "arguments": {k: v for k, v in self.arguments.items() if k not in kind.resolved},
            **(by_source if kind.is_by_source else {}),
            **kind.identity(self.read),
        }

    def limit(self, text: str) -> Limit:
        """Return a limit of one of its figures."""
        limited = KINDS[self.kind].limit
        if limited is None:
            raise ParameterError(
                f"[[evidence]] {self.kind} does not accept a limit, because its own checks decide. "
                "Remove the key limit",
                name="limit",
                value=text,
            )
        return limited(self.read, text)

    def compute(self, folder: Path, progress: Progress) -> Computed:
        """Compute the result, and write its report."""
        kind = KINDS[self.kind]
        asked = {**self.asked, **kind.fixed}
        answer = kind.case.call(asked, progress=progress, out=folder)
        if kind.has_report:
            answer.write(folder)
        figures = answer.key_figures
        judged = [judge_limit(limit, figures) for limit in answer.own_limits]
        return Computed(answer, {each.limit: each for each in judged})


def read_kind(kind: str, subject: str, arguments: Mapping[str, Any], folder: Path) -> UseCaseTask:
    """Read the evidence of a kind.

    Parameters
    ----------
    kind, subject, arguments
        The key, its value, and the other keys of the ``[[evidence]]``.
    folder
        Folder of the sign-off file, to which paths are relative.

    Raises
    ------
    InputError
        For invalid entries.
    """
    chosen = KINDS[kind]
    for name in arguments:
        if name not in chosen.arguments:
            raise unknown_of_few(f"key of [[evidence]] {kind}", name, (*chosen.arguments, *_OTHERS))
    asked = {name: value_of(chosen.arguments[name], v, folder) for name, v in arguments.items()}
    asked[chosen.key] = there(subject, chosen.subject_argument, folder)
    return UseCaseTask(kind, subject, arguments, folder, asked, chosen.read(asked))


_OTHERS: Sequence[str] = ("shows", "limit", "note")
