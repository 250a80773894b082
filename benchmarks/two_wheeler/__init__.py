"""Speed of the two-wheeler: a controlled stop by hand."""
