#!/usr/bin/env bash
# Builds the Python package, and tests it as its users have it: from the wheel, in an environment of its own.
#
#   scripts/python.sh wheel               target/wheels/finalgather-*.whl, for Python 3.9 and later, and the glibc of this system
#   GLIBC=2.28 scripts/python.sh wheel    the same for that glibc, built anew by Zig in ten minutes
#   scripts/python.sh test                the wheel, its tests with numpy and pytest alone, then types, notebooks and examples with all that they need
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}

case "${1-}" in
    wheel | test) what=$1 ;;
    *) echo "usage: scripts/python.sh wheel|test" >&2; exit 2 ;;
esac

# environment NAME PACKAGE...: makes it if it is missing, and installs into it
environment() {
    local place=$target/python/$1
    shift
    # Its interpreter may have gone with a system that was renewed.
    "$place/bin/python" -c "" 2>/dev/null || python3 -m venv --clear "$place"
    "$place/bin/pip" install --quiet --disable-pip-version-check "$@"
}

environment build 'maturin>=1.9,<2'
maturin() { "$target/python/build/bin/maturin" build --quiet --release --locked --manifest-path python/Cargo.toml --out "$target/wheels" "$@"; }
rm -rf "$target/wheels"
if [[ ${GLIBC-} ]]; then
    environment build ziglang
    # Maturin asks the first Python on the path for Zig.
    PATH=$(realpath "$target/python/build/bin"):$PATH CARGO_TARGET_DIR=$target/python/zig \
        maturin --zig --compatibility "manylinux_${GLIBC/./_}"
else
    maturin
fi
wheel=$(echo "$target"/wheels/finalgather-*.whl)
echo "$wheel"
[[ $what == test ]] || exit 0

FINALGATHER=$(realpath "$target/release/finalgather")
export FINALGATHER
# Clean: a package that the wheel needs and does not name would be missed.
rm -rf "$target/python/plain"
environment plain numpy pytest "$wheel"
"$target/python/plain/bin/pytest" --quiet python/tests --ignore=python/tests/extras

environment extras -r python/tests/extras/requirements.txt
environment extras --force-reinstall --no-deps "$wheel"
bin=$target/python/extras/bin
"$bin/abi3audit" --strict "$wheel"
"$bin/pytest" --quiet python/tests/extras
