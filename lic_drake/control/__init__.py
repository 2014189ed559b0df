"""Tactile sensing and the quasi-static model predictive controller."""
