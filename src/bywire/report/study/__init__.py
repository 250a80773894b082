"""Figures of studies: spread of key figures, their drivers, and convergence of estimates."""
