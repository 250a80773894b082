"""Linear models: operating points, exact Jacobians, sampled loops."""
