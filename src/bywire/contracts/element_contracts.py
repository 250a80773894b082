"""All contracts of an element or a control law."""

from __future__ import annotations

from bywire.contracts import energy, equations, values
from bywire.contracts.elements import Element, parameter_classes
from bywire.contracts.evidence import Contract
from bywire.contracts.finding import Demand, Demands

OF_A_FUNCTION: dict[str, Contract] = {
    "units": equations.has_annotated_units,
    "SI units": equations.is_in_SI,
    "back ends": equations.has_agreeing_back_ends,
    "derivatives": equations.has_its_slopes,
}
"""what every public function has to keep"""

OF_A_CLASS: dict[str, Contract] = {
    "round trip": values.survives_json,
    "refusals": values.keeps_its_ranges,
}
"""what every class of parameters has to keep"""


def demands_on(element: Element) -> Demands:
    """Yield every contract that an element has to keep."""
    functions = element.functions
    for name, function in functions.items():
        for contract, test in OF_A_FUNCTION.items():
            yield Demand(contract, f"{element.name}.{name}", function, test)
    module = element.module
    if {"mass", "balance"} <= functions.keys():
        yield Demand("rates", element.name, module, energy.has_rates_of_its_states)
    if "energy" in functions:
        yield Demand("energy balance", element.name, module, energy.keeps_energy)
    if "power_loss" in functions:
        yield Demand("loss", element.name, module, energy.loses_what_it_says)
    for cls in parameter_classes(module):
        for contract, test in OF_A_CLASS.items():
            yield Demand(contract, f"{element.name}.{cls.__name__}", cls, test)
