"""What subcommands share when they declare their arguments."""

import argparse

type Subparsers = argparse._SubParsersAction[argparse.ArgumentParser]
"""What `add_parser` of a subcommand gets."""


def positive_int(text: str) -> int:
    """Reads a whole number of 1 or more; for `type=` of an argument."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"needs a whole number of 1 or more, got {text!r}")
    return value
