"""Robots: kinematics, limits, and how each is added to a plant."""
