"""One-screen programs with the public API."""
