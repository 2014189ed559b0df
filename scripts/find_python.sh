#!/bin/sh
# Prints the path of a Python interpreter that can run lic_drake, or one line that says what to install.
#
# $PYTHON decides if it is set. Otherwise each version is looked for on the PATH (python3.12, then a
# python3 of that version) and in pyenv's versions folder. The first version that runs wins; 3.12
# comes first because CI runs it.
set -u

# 0: usable; 1: not CPython >= 3.12 with the GIL, or does not run (a pyenv shim may lead nowhere);
# 2: usable, but it cannot make virtual environments.
check() {
    [ -f "$1" ] && [ -x "$1" ] && "$1" -I -c '
import sys, sysconfig
if (
    sys.version_info < (3, 12)
    or sys.implementation.name != "cpython"
    or sysconfig.get_config_var("Py_GIL_DISABLED")
):
    sys.exit(1)
if sys.argv[1:] and "%d.%d" % sys.version_info[:2] != sys.argv[1]:
    sys.exit(1)
try:
    import ensurepip, venv
except ImportError:
    sys.exit(2)
' ${2:+"$2"} >/dev/null 2>&1
}

fail() {
    echo "find_python: $1" >&2
    exit 1
}

# Prints $1 and ends if it is usable (as version $2, if given).
without_venv=
try() {
    check "$1" ${2:+"$2"}
    case $? in
        0) echo "$1" && exit 0 ;;
        2) without_venv=${without_venv:-$1} ;;
    esac
}

# Tries every $1 on the PATH: the first one may be an empty shim, the second one may run.
try_on_path() {
    rest=$PATH:
    while [ -n "$rest" ]; do
        dir=${rest%%:*}
        rest=${rest#*:}
        try "${dir:-.}/$1" ${2:+"$2"}
    done
}

if [ -n "${PYTHON:-}" ]; then
    chosen=$(command -v "$PYTHON") || fail "PYTHON=$PYTHON is not a program; give the path of a Python 3.12 or newer"
    try "$chosen"
    [ -z "$without_venv" ] || fail "PYTHON=$PYTHON cannot make virtual environments (no ensurepip); on Debian: apt-get install python3-venv"
    fail "PYTHON=$PYTHON is not a working CPython 3.12 or newer ($("$chosen" --version 2>&1 | head -n 1))"
fi

versions=${PYENV_ROOT:-${HOME:-}/.pyenv}/versions
for version in 3.12 3.13 3.14; do
    try_on_path "python$version" "$version"
    try_on_path python3 "$version"
    for home in "$versions/$version".*; do
        try "$home/bin/python3" "$version"
    done
done
try_on_path python3
for home in "$versions"/3.1[5-9].*; do
    try "$home/bin/python3"
done

[ -z "$without_venv" ] || fail "$without_venv cannot make virtual environments (no ensurepip); on Debian: apt-get install python3-venv"
fail "no Python 3.12 or newer found; install one (Debian 13, Ubuntu 24.04: apt-get install python3-venv; elsewhere: pyenv install 3.12) or set PYTHON=/path/to/python3.12"
