"""A Dask worker on a machine with another lic_drake, for tests that refuse it."""

import importlib.metadata

from distributed.cli.dask_worker import main


def another_version(_: str) -> str:
    return "0.0.1"


# Before anything is forked or imported again; what runs in the worker itself has no nanny.
importlib.metadata.version = another_version

if __name__ == "__main__":
    main()
