"""Perception: simulated cameras, and what is found in their images (paper V-B)."""
