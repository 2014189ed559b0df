"""A speed-up: objects that nothing touches are left out of the plant until the arm comes near.

Everything works without this folder: `lic_drake.reach.environment` has the one switch. A simulated
second costs a third with it, and reaches end the same but for the last digits.
"""
