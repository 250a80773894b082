"""Measurements of Dardanelli et al. (2010), and the parameters that explain them best."""
