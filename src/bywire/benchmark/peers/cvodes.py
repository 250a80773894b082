"""CVODES through CasADi: variable-order BDF with exact Jacobians, the friction as a tanh."""

from __future__ import annotations
