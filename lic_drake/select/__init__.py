"""Selecting the initial condition of a reach: LIC-1 and the strategies it is compared with."""
