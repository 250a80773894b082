"""Any parameters of any bench by output error, open or closed loop (Ljung 1999, section 7.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.signals import signals_of
from bywire.identification.fitting.asked import Asked, BenchMethod
from bywire.identification.fitting.bench_fit import BenchFit
from bywire.identification.fitting.options import Options
from bywire.identification.fitting.output_noise import noise_given
from bywire.identification.fitting.simulated import simulated
from bywire.identification.fitting.unknown_texts import is_parameter, unknowns_of
from bywire.identification.method import Method
from bywire.identification.replaying.measured_run import case_of

_NAME = "output-error"
_DEFAULTS = Options(
    loss="linear", between="held", most_residual=1.3, most_outliers=0.05, least_vaf=0.9, noise=2e-3
)
_SIMULATED = ("noise",)


def on(bench: Bench, asked: Asked) -> Method:
    """Return the method for what is asked of a bench.

    Parameters
    ----------
    bench
        Gives model, experiment, and all that is known.
    asked
        What is measured and what is unknown.

    Raises
    ------
    InputError
        When something that is asked for is not there, or cannot be read.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, 2nd ed., 1999, section 7.2.
    """
    case = case_of(bench, asked.case)
    _require_known(case, asked)
    unknowns_of(case, bench.par, asked)
    stimuli, outputs = signals_of(case.model.Stimulus), signals_of(case.model.Output)
    driving = [name for name in stimuli if not name.startswith("noise_")]
    measured = {name: outputs[name].unit for name in asked.outputs}
    for name, text in asked.outputs.items():
        if text:
            noise_given(name, text, measured[name])
    fit = BenchFit(bench, asked)
    return Method(
        name=_NAME,
        assembly=bench.system,
        summary=f"parameters of {bench.experiment} by output error",
        experiment=bench.experiment,
        signals={s: stimuli[name].unit for name, s in asked.inputs.items()} | measured,
        optional={} if asked.inputs else {name: stimuli[name].unit for name in driving},
        options=Options,
        defaults=_DEFAULTS,
        identify=fit.identify,
        synthetic=_Simulation(fit),
        unknowns=tuple(filter(is_parameter, asked.unknowns)),
        several=True,
        gaps=True,
        simulated=_SIMULATED,
        bench=bench,
        key=f"{bench} {asked.key}",
    )


@dataclass(frozen=True)
class _Simulation:
    """The experiment with given parameters, simulated."""

    fit: BenchFit

    def __call__(self, par: Any, options: Options, seed: int) -> xr.Dataset:
        return simulated(self.fit.moved(par), self.fit.asked, options, seed)


def _require_known(case: Case, asked: Asked) -> None:
    """Refuse names of signals and states that the model does not have."""
    outputs, stimuli = signals_of(case.model.Output), signals_of(case.model.Stimulus)
    if not asked.outputs:
        raise ParameterError(
            "no output is measured: give --output SIGNAL, once for each of the model's outputs "
            f"that the record has, for instance {', '.join(list(outputs)[:6])}"
        )
    for kind, names, known in (
        ("output", asked.outputs, outputs),
        ("stimulus", asked.inputs, [n for n in stimuli if not n.startswith("noise_")]),
        ("state in --estimate-start", asked.states, case.model.State._fields),
    ):
        for name in names:
            if name not in known:
                raise unknown_name(kind, name, known)


METHOD = BenchMethod(
    name=_NAME,
    summary="any parameters of any bench: its model, driven by what was measured, beside its "
    "outputs",
    options=Options,
    defaults=_DEFAULTS,
    simulated=_SIMULATED,
    on=on,
)
