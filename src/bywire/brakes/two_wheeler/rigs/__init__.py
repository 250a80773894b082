"""A wheel on a drum, and the vehicle with a whole brake at its rear wheel."""
