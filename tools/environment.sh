# Sourced by tools/quickstart, tools/test and .ci/run: prepare LEVEL makes or completes the virtual environment.
#
# LEVEL is a file of requirements/: run, test, dev or site. The environment is .venv, or the folder OBSEQ_VENV names;
# it is made with the Python that PYTHON names, or with the first suitable one found.
# A second call finds the stamp of the first and does nothing.

root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd -P)
venv=${OBSEQ_VENV:-$root/.venv}
case $venv in
    /*) ;;
    *) venv=$PWD/$venv ;;
esac

die() {
    printf '%s\n' "$*" >&2
    exit 2
}

supported='import sys; sys.exit(sys.version_info < (3, 11))'
find_all='from importlib.util import find_spec as f; [f(n).origin for n in ("obseq", "numpy", "scipy", "numba", "pyproj")]'

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        set -- "$PYTHON"
    else
        set -- python3.13 python3.12 python3.11 python3 python
    fi
    for candidate; do
        if "$candidate" -c "$supported" >/dev/null 2>&1; then
            command -v "$candidate"
            return
        fi
    done
    die "No Python 3.11 or later was found${PYTHON:+ at $PYTHON}. Install one, or name it: PYTHON=/path/to/python3 $0"
}

# What the environment depends on: the place, the pinned versions, the packaging, and the Python that made it.
fingerprint() {
    cat "$root/pyproject.toml" "$root"/requirements/*.txt "$venv/pyvenv.cfg" | cksum | tr -d ' \n'
    printf ' %s' "$root"
}

usable() {
    "$venv/bin/python" -c "$supported" >/dev/null 2>&1 && "$venv/bin/python" -m pip --version >/dev/null 2>&1
}

# A stamp reads "LEVEL CHECKSUM PLACE"; each level contains the ones before it.
stamped() {
    [ -f "$venv/obseq-stamp" ] || return 1
    read -r level print <"$venv/obseq-stamp" || return 1
    [ "$print" = "$(fingerprint)" ] || return 1
    case "$1:$level" in
        run:* | test:test | test:dev | test:site | dev:dev | dev:site | site:site) ;;
        *) return 1 ;;
    esac
}

# An environment with a stamp where something is missing was damaged.
damaged() {
    [ -f "$venv/obseq-stamp" ] && ! "$venv/bin/python" -c "$find_all" >/dev/null 2>&1
}

# Scripts of an environment that was moved name the old place.
moved() {
    [ -f "$venv/obseq-stamp" ] && read -r _ _ place <"$venv/obseq-stamp" && [ "$place" != "$root" ]
}

make_environment() {
    python=$(find_python) || exit 2
    printf 'Making %s with %s\n' "$venv" "$python" >&2
    "$python" -m venv --clear "$venv" ||
        die "The virtual environment could not be made. On Debian and Ubuntu, install the package python3-venv first."
}

install() {
    printf 'Installing the pinned packages (requirements/%s.txt)\n' "$1" >&2
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --only-binary :all: --require-hashes \
        -r "$root/requirements/$1.txt" &&
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e "$root" &&
        compile_ours
}

# As pip does for what it installs elsewhere: the first start is a second shorter.
compile_ours() {
    "$venv/bin/python" -m compileall -q "$root/src" "$root/formulas" "$root/codegen" "$root/generated"
}

prepare() {
    stamped "$1" && ! damaged && return
    if moved || damaged || ! usable; then
        make_environment
    fi
    rm -f "$venv/obseq-stamp"
    install "$1" || die "The installation failed; the messages above say why. Run $0 again when the cause is gone."
    printf '%s %s\n' "$1" "$(fingerprint)" >"$venv/obseq-stamp"
}
