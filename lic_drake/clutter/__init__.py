"""Clutter categories, sampled as plain arrays. No Drake here."""
