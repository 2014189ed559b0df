"""The simulated world: a plant and scene graph from a robot and a clutter instance."""
