"""Clutter categories: plain arrays that say what stands where. No Drake here."""
