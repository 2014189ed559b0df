"""The same reaches in other simulators, for `scripts/benchmark_peers.py`."""
