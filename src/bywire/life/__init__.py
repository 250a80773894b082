"""Life: what changes a little with every stop, projected over thousands of them."""
