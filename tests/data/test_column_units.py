"""Units of columns that are SI as they stand."""

from __future__ import annotations

import numpy as np

from bywire.data import column_units as known


def test_units_that_need_no_table_of_units() -> None:
    """What is SI as it stands is told apart and converted as the table of units has it."""
    for text, symbol in known._WHOLE.items():
        whole, other = known.unit_of(text), known._of_pint(text)
        assert isinstance(whole, known.Whole)
        assert known.si_symbol(whole) == known.si_symbol(other) == symbol
        for wanted in known._WHOLE:
            same = known.measures(other, wanted)
            assert known.measures(whole, wanted) == same, (text, wanted)
            if same:
                values = np.array([2.0, np.nan])
                np.testing.assert_array_equal(known.converted(values, whole, wanted), values)
                np.testing.assert_array_equal(known.converted(values, other, wanted), values)
    assert known.measures(known.unit_of("Pa"), "Pa")
    assert known.converted(np.ones(1), known.unit_of("bar"), "Pa") == 1e5
