"""What Dardanelli et al. (2010) measured, and the parameters that explain it best."""
