"""What makes the loops of the motorcycle brake nonlinear, and how each of it is switched off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CAUSES: Mapping[str, Mapping[str, Any]] = {
    "seal friction": {"seal.T_pr": 0.0, "seal.f_cfr_p": 0.0, "seal.f_cfr_n": 0.0,
                      "seal.mu_T": 0.0},
    "dither": {"ecu.dither.waveform": "off"},
    "converter": {"adc.law": "ideal"},
}  # fmt: skip
"""cause -> parameters without it"""
