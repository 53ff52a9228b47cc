#!/usr/bin/env bash
# Makes dist/ from the last commit: a wheel and a source distribution, twice with the same bytes, the wheel
# installed with the lock into an empty environment and tried there.
#
# Exit 0 made and tried, 1 something differs or fails, 2 something to do first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf 'release: %s\n' "$*" >&2; }

if [[ -n $(git status --porcelain) ]]; then
  say "commit what is changed first: a release is made from a commit"
  exit 2
fi
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

built() { # a wheel and a source distribution of a clean tree, into $1
  mkdir "$1" "$1/tree"
  git archive HEAD | tar --extract --directory "$1/tree"
  (cd "$1/tree" && "$PYTHON" -c '
import sys
from setuptools import build_meta
into = sys.argv[1]  # which building changes
build_meta.build_sdist(into)
build_meta.build_wheel(into)' "$1") >"$1/log" 2>&1 || { tail -n 5 "$1/log" >&2; exit 1; }
  local source name
  source=$(echo "$1"/*.tar.gz)
  name=$(basename "$source" .tar.gz)
  tar --extract --gzip --file "$source" --directory "$1"
  tar --create --directory "$1" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 \
    --numeric-owner --mode=u=rwX,go=rX "$name" | gzip --no-name >"$source"
  rm -rf "$1/tree" "$1/log" "${1:?}/$name"
}

PYTHON=$PWD/.venv/bin/python
built "$work/one"
built "$work/two"
if ! diff --recursive --brief "$work/one" "$work/two"; then
  say "made twice, they differ"
  exit 1
fi
say "made twice with the same bytes; trying the wheel in an empty environment"
"$PYTHON" -m venv "$work/empty"
install=("$work/empty/bin/python" -m pip --disable-pip-version-check --quiet install)
if uv=$(type -P uv || type -P .venv/bin/uv); then
  install=("$uv" pip install --quiet --python "$work/empty/bin/python")
fi
"${install[@]}" --requirement requirements.lock
"${install[@]}" --no-deps "$work"/one/*.whl
(cd "$work" && empty/bin/vsr run fragility --site cuboid_1x1x2 --quiet --set yaw=0 \
  --set 'motion.pga=[0.3,0.9]' --set 'motion.pgv_pga=[0.3]' --set simulation.time_step=0.004)
mkdir -p dist
cp "$work"/one/* dist
(cd dist && sha256sum -- *.whl *.tar.gz)
