"""Tests of ``bywire.contracts``, the contracts of all elements, parameter sets and models."""
