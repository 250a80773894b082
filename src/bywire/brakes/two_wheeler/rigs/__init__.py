"""A wheel on a drum, and a vehicle with a whole brake at its rear wheel."""
