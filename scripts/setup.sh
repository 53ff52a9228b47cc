#!/usr/bin/env bash
# Makes .venv from requirements.lock when it is missing or stale; returns at once when it is fresh.
#
#   scripts/setup.sh                    exit 0 ready, 1 an installation failed, 2 something to install
#   scripts/setup.sh lock [--upgrade]   make requirements.lock from pyproject.toml
#
# Python is $PYTHON if set, else 3.11 if there is one, else the oldest newer one. .venv/.ready is
# written last, so that what failed or was interrupted starts afresh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly READY=.venv/.ready LOG=.venv/setup.log
readonly PIP=(.venv/bin/python -m pip --disable-pip-version-check --no-input)

# What a Python is, one fact per line; older Pythons than 3 fail on it, which is an answer too.
readonly PROBE='
import os, platform, sys, sysconfig
try:
    import ensurepip, venv
    pip = bool(ensurepip.version())
except Exception:
    pip = False
built = sys.version_info[:2] == (3, 11) and (sys.platform, platform.machine()) == ("linux", "x86_64")
header = os.path.join(sysconfig.get_path("include"), "Python.h")
print(sys.version_info[1] if sys.implementation.name == "cpython" else 0, platform.python_version(),
      int(pip), int(built), int(os.path.exists(header)), sys._base_executable, sep="\n")
'

say() { printf 'setup: %s\n' "$*" >&2; }

# Stamp -------------------------------------------------------------------------------------------

stamp() { # the lines of a stamp: the lock and its place, the project, the Python, the one asked for
  printf '%s %s\n%s\n%s\n%s\n' "$lock_sum" "$PWD" "$project_sum" "$1" "$2"
}

fresh() { # what is there: all of it, or "locked" where only the project changed
  local was=() line
  [[ -f $READY && -x .venv/bin/python && -x .venv/bin/vsr ]] || return 1
  while IFS= read -r line; do was+=("$line"); done <"$READY"
  [[ ${#was[@]} == 4 && ${was[0]} == "$lock_sum $PWD" ]] || return 1
  [[ $1 == locked || ${was[1]} == "$project_sum" ]] || return 1
  if [[ -n ${PYTHON-} && $PYTHON != "${was[2]}" && $PYTHON != "${was[3]}" ]]; then
    if suits "$PYTHON" && [[ $python != "${was[2]}" ]]; then return 1; fi
  fi
  python=${was[2]} asked=${was[3]}
}

# Python ------------------------------------------------------------------------------------------

candidates() { # paths that may be Python 3.$1; each has still to show it
  type -ap "python3.$1" python3 python || true
  printf '%s\n' "${PYENV_ROOT:-${HOME-}/.pyenv}/versions/3.$1."*/bin/python |
    awk -F/ '{ n = split($(NF - 2), part, "."); print part[n], $0 }' | sort -rn | cut -d ' ' -f 2-
  if command -v uv >/dev/null; then uv python find --system "3.$1" 2>/dev/null || true; fi
}

suits() { # does the Python at $1 do, as version 3.$2 or as any from 3.11? else a hint on what it lacks
  local facts=() fact
  hint=${hint-}
  [[ -n $(type -P -- "$1") ]] || return 1
  while IFS= read -r fact; do facts+=("$fact"); done < <("$1" -I -c "$PROBE" 2>/dev/null)
  [[ ${#facts[@]} == 6 ]] || return 1
  local minor=${facts[0]} pip=${facts[2]} header=${facts[4]}
  ((minor >= 11)) && [[ -z ${2-} || $minor == "$2" ]] || return 1
  version=${facts[1]} wheel=${facts[3]} python=${facts[5]}
  if ((!pip)); then
    hint=${hint:-"python3.$minor-venv for the Python $version found here"}
  elif ((!wheel)) && ! command -v "${CXX:-g++}" >/dev/null; then
    hint=${hint:-"g++ for the Python $version found here, on which pybullet builds from source"}
  elif ((!wheel && !header)); then
    hint=${hint:-"python3.$minor-dev for the Python $version found here, on which pybullet builds from source"}
  else
    return 0
  fi
  return 1
}

choose() { # sets python, version and wheel (0: pybullet has to be built), or ends with what to install
  local minor path
  hint=''
  if [[ -n ${PYTHON-} ]] && suits "$PYTHON"; then return; fi
  for minor in 11 12 13 14 15; do
    while IFS= read -r path; do
      suits "$path" "$minor" || continue
      [[ -z ${PYTHON-} ]] || say "PYTHON=$PYTHON is no Python from 3.11 that will do; $python is"
      return
    done < <(candidates "$minor")
  done
  say "install Python 3.11 with venv, or ${hint:-"a newer Python and g++"}; then run this again"
  exit 2
}

# Installation ------------------------------------------------------------------------------------

quietly() { # run, with all that it prints in the log only
  printf '\n$ %s\n' "$*" >>"$LOG"
  "$@" >>"$LOG" 2>&1 || failed
}

failed() {
  say "failed; the last lines of $LOG:"
  tail -n 12 "$LOG" | sed 's/^/  | /' >&2
  say "if the network or the disk was the reason, the same command starts afresh"
  exit 1
}

install() {
  choose
  asked=${PYTHON-}
  if ((wheel)); then
    say "making .venv with Python $version, about a minute"
  else
    say "making .venv with Python $version, on which pybullet builds from source: 4 to 5 minutes on two cores"
  fi
  rm -f "$READY" # before anything else, as the removal itself may be interrupted
  rm -rf .venv
  mkdir .venv
  quietly "$python" -m venv .venv
  # What has to be built is built with the setuptools of the lock, not with the newest one.
  awk '/^[^ #]/ { on = /^setuptools==/ } on' requirements.lock >.venv/setuptools.lock
  quietly "${PIP[@]}" install --progress-bar off --require-hashes -r .venv/setuptools.lock
  quietly "${PIP[@]}" install --progress-bar off --require-hashes --no-build-isolation --use-pep517 \
    -r requirements.lock
}

install_project() {
  quietly "${PIP[@]}" install --no-deps --no-build-isolation --editable .
  if ! "${PIP[@]}" check >>"$LOG" 2>&1; then
    say "requirements.lock does not fit pyproject.toml: \`make lock\` renews it"
    failed
  fi
  quietly .venv/bin/python -m compileall -q pipeline vsr_core
  stamp "$python" "$asked" >"$READY.new"
  mv "$READY.new" "$READY"
}

lock() {
  local uv
  if ! uv=$(type -P uv); then
    choose
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    "$python" -m venv "$folder"
    "$folder/bin/python" -m pip --disable-pip-version-check install --quiet uv
    uv=$folder/bin/uv
  fi
  "$uv" pip compile --universal --python-version 3.11 --generate-hashes --extra dev --quiet \
    --custom-compile-command 'make lock' --output-file requirements.lock "$@" pyproject.toml
}

# Packages of other installations (a sourced ROS, say) must not pass for those of the lock.
unset PYTHONHOME PYTHONPATH PYTHONDONTWRITEBYTECODE PIP_USER PIP_TARGET PIP_PREFIX
if [[ ${1-} == lock ]]; then
  lock "${@:2}"
  exit
fi
lock_sum=$(cksum <requirements.lock)
project_sum=$(cksum <pyproject.toml)
fresh all && exit

# One at a time; where there is no flock, two at once are the user's to avoid.
if command -v flock >/dev/null; then
  exec 9<scripts/setup.sh
  flock --nonblock 9 || { say "another setup is under way; waiting for it" && flock 9; } || true
fi
trap 'say "stopped; the next run starts afresh"; exit 130' INT TERM
fresh all && exit
if fresh locked; then
  rm "$READY"
  say "pyproject.toml changed: installing the project again"
else
  install
fi
install_project
say "done in $SECONDS s"
