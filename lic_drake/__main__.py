"""`python -m lic_drake` is the `lic` command."""

from lic_drake.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
