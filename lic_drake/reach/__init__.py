"""A reach as a function: `ReachRequest` in, `ReachRecord` out."""
