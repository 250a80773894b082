"""From measurements to parameters: estimators, their confidence, and named methods."""

from bywire.identification.bench_fit import Prediction, predict
from bywire.identification.confidence import Disagreement, MisfitWarning, disagreements
from bywire.identification.differentiation import differentiated
from bywire.identification.equation import Equation, inverse_dynamics
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.model_choice import Candidate, choose
from bywire.identification.multistart import multistart
from bywire.identification.output_error import Driven, Trial, initial_states, output_error, trial
from bywire.identification.unknown import Unknown, parameters_of

__all__ = [
    "Candidate",
    "Disagreement",
    "Driven",
    "Equation",
    "Estimate",
    "MisfitWarning",
    "Prediction",
    "Problem",
    "Trial",
    "Unknown",
    "choose",
    "differentiated",
    "disagreements",
    "estimate",
    "initial_states",
    "inverse_dynamics",
    "multistart",
    "output_error",
    "parameters_of",
    "predict",
    "trial",
]
