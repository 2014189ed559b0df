"""Experiments of this repository, a folder each: `python scripts/<name>/run.py`, see README.md."""
