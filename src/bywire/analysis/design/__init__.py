"""Design of control loops: requirements in, gains and what they give out."""
