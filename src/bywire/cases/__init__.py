"""Long work in pieces: what tells one from another, who computes them, where finished ones lie."""
