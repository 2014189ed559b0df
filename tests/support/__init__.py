"""Helpers of the tests: made-up reaches, small worlds, reference values."""
