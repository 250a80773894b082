"""Speed: a controlled stop by hand."""
