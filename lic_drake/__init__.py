"""Learning initial conditions for reaching into unknown clutter, on Drake.

Implements Park, Kapusta, Kim, Rehg and Kemp, "Learning to Reach into the Unknown: Selecting
Initial Conditions When Reaching in Clutter". Nothing heavy is imported here.
"""

__version__ = "0.1.0"
