"""From measurements to parameters: estimators, their confidence, and named methods."""

from bywire.identification.differentiation import differentiated
from bywire.identification.equation import Equation
from bywire.identification.estimate import Estimate
from bywire.identification.inverse_dynamics import inverse_dynamics
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.output_error import Trial, initial_states, output_error, trial
from bywire.identification.unknown import Unknown, parameters_of

__all__ = [
    "Equation",
    "Estimate",
    "Problem",
    "Trial",
    "Unknown",
    "differentiated",
    "estimate",
    "initial_states",
    "inverse_dynamics",
    "output_error",
    "parameters_of",
    "trial",
]
