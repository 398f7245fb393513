#!/usr/bin/env bash
# Every figure, table and claim of the three papers, on a machine with nothing but Python 3.11 or newer.
#
#     ./reproduce.sh
#
# It makes .venv beside this file, installs refsim there and runs `refsim reproduce`. Interrupted at any moment, the same
# command goes on where it stopped. PYTHON names the interpreter to take, by name or whole path; parameters, none of
# which is needed, go to `refsim reproduce` (`./reproduce.sh --quick` takes minutes instead of an hour). What is made lies
# in this folder, and a relative `--out` is counted from it; a relative REFSIM_SCENES is counted from where you are.
set -euo pipefail
if [ -n "${REFSIM_SCENES:-}" ]; then
    case $REFSIM_SCENES in
        /*) ;;
        *) export REFSIM_SCENES=$PWD/$REFSIM_SCENES ;;
    esac
fi
cd "$(dirname "${BASH_SOURCE[0]}")"

stop() {
    echo "reproduce.sh: $1" >&2
    exit 2
}

find_python() {
    local name names=(python3 python python3.14 python3.13 python3.12 python3.11)
    # One word, whatever it holds: a path may have a space in it.
    [ -z "${PYTHON:-}" ] || names=("$PYTHON")
    for name in "${names[@]}"; do
        if "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' > /dev/null 2>&1; then
            echo "$name"
            return
        fi
    done
    return 1
}

# The stamp is written last, so an installation that was cut off, or is older than the code, is made again. So is one
# that was moved: its programs name the folder that they were made in, and only starting one tells.
stamp=.venv/installed-refsim
if [ ! -e "$stamp" ] || ! .venv/bin/refsim --version > /dev/null 2>&1 || [ -n "$(find refsim pyproject.toml -newer "$stamp" \
    ! -path '*/__pycache__*' ! -type d -print -quit)" ]; then
    python=$(find_python) || stop "no Python 3.11 or newer is found${PYTHON:+ as $PYTHON}; install one, or name one in PYTHON"
    "$python" -c 'import venv, ensurepip' 2> /dev/null \
        || stop "$python lacks the module venv (on Debian and Ubuntu the package python3-venv has it)"
    echo "installing refsim into .venv"
    "$python" -m venv .venv || stop ".venv cannot be made"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -e . \
        || stop "the packages cannot be installed; is there a network? The same command tries again"
    touch "$stamp"
fi

# What is not here is said first: tables then read `missing`, and nothing takes its place unsaid.
.venv/bin/refsim doctor | grep -E 'REFSIM_SCENES|meshes|problem' || true
echo "every mesh is optional; .venv/bin/refsim scenes fetch --help says how to have more"
exec .venv/bin/refsim reproduce "$@"
