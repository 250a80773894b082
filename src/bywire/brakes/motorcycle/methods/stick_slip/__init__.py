"""Friction from stick and slip: slips found, shot one by one, and the curve that they give."""
