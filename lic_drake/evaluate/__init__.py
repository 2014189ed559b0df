"""Evaluation: trials, figures and tables."""
