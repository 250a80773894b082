"""Dynamics of the braking system: records by pressure region, and the transfer function in them."""
