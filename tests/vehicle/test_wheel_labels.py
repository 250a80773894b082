"""Labels of a vehicle's signals name the wheel in words."""

from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of


def test_labels_of_the_wheels_name_front_and_rear() -> None:
    for name in ("two-wheeler-by-wire", "two-wheeler-whole-rear"):
        model = ASSEMBLIES.find(name)()
        labels = {
            s.label for part in (model.Output, model.State) for s in signals_of(part).values()
        }
        assert "pressure, front" in labels
        assert not [label for label in labels if label.endswith((" f", " r"))]
