"""Checks that a wheel holds every tracked file of the package and of models/, and nothing else.

Usage: check_wheel.py WHEEL, inside the git checkout.
"""

import subprocess
import sys
import zipfile


def main() -> int:
    """Returns 0 when the wheel's files are the tracked ones."""
    tracked = subprocess.run(
        ["git", "ls-files", "-z", "lic_drake", "models"], check=True, capture_output=True, text=True
    ).stdout.split("\0")
    expected = {
        f"lic_drake/{name}" if name.startswith("models/") else name for name in tracked if name
    }
    with zipfile.ZipFile(sys.argv[1]) as wheel:
        found = {name for name in wheel.namelist() if ".dist-info/" not in name}
    for name in sorted(expected - found):
        print(f"the wheel lacks {name}", file=sys.stderr)
    for name in sorted(found - expected):
        print(f"the wheel has {name}, which git does not track", file=sys.stderr)
    print(f"the wheel has {len(found)} files")
    return int(found != expected or not expected)


if __name__ == "__main__":
    sys.exit(main())
