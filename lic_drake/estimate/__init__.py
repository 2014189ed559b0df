"""Estimators F(s, x0) of the probability that a reach succeeds (paper III-D)."""
