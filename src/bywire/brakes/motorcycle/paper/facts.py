"""Statements of Dardanelli, Alli, Savaresi (2010), our tolerances, and models from their tables."""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.motorcycle.linear import Rational, first_orders
from bywire.brakes.motorcycle.sets import dardanelli2010
from bywire.reproduction.source_file import SourceFile

CITATION = dardanelli2010.FILE.citation
FILE = SourceFile(Path(__file__).with_name("dardanelli2010.toml"))
FACTS, ALLOWANCES = FILE.facts, FILE.allowances

REGIONS = {"low": 5e5, "medium": 25e5, "high": 37e5}
"""a pressure [Pa] inside each region of Table 4, our choice; Fig. 6 begins at 25 bar"""


def table2_model() -> Rational:
    """Return the transfer function printed in Table 2 [Pa/A]."""
    row = FACTS.table("table2")
    return first_orders(
        "Table 2 as printed",
        row["K"].value * 1e5,
        (row["zero"].value,),
        tuple(row[name].value for name in ("pole1", "pole2", "pole3")),
    )


def table4_model(region: str) -> Rational:
    """Return eq. (22) with the values of Table 4 [Pa/A]."""
    row = FACTS.table(f"table4.{region}")
    return first_orders(
        f"Table 4, {region} pressure",
        row["K"].value * 1e5,
        (row["zero"].value,),
        tuple(row[name].value for name in ("T1", "T2", "T_L")),
    )
