"""A brake's life: small changes by each stop, projected over thousands of stops."""
