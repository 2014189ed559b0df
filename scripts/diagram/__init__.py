"""A drawing of the reach diagram."""
