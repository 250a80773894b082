"""Options of a fit of any bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Unit
from bywire.identification.least_squares import Loss
from bywire.identification.replaying.measured_run import Between

Share = Annotated[float, Unit("1", 0.01), Field(ge=0, le=1, allow_inf_nan=False)]


class Options(ParameterSet):
    """How large residuals count, and what is asked of the result."""

    loss: Loss
    """how large residuals count: beyond the noise a robust loss grows slower than the square"""
    between: Between
    """what inputs do between samples: held as a controller's demand is, or joined by straight lines
    as something smooth is that acts on the model faster than it was measured"""
    most_residual: Factor
    """residual over noise above which the model does not explain the record"""
    most_outliers: Share
    """residuals beyond four times the noise, of all, that a robust loss may set aside"""
    least_vaf: Share
    """variance of the held-out record that is to be accounted for, signal by signal"""
    noise: Share
    """synthetic: standard deviation of an output's noise, of its range, where none is given"""
