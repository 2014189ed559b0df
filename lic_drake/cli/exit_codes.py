"""Exit codes of the `lic` command; 0 is success."""

INCOMPLETE = 1
"""The command ran, but its result is not what was hoped for; the output says why."""

USER_ERROR = 2
"""The arguments or a file cannot be used; argparse uses the same code."""

INTERRUPTED = 130
"""Ctrl-C, as shells report it."""

BROKEN_PIPE = 141
"""The reader of the output has gone, as shells report it."""
