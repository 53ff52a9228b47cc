#!/usr/bin/env bash
# Makes .venv from the locks where it is missing or stale; returns at once where it is fresh.
#
#   scripts/setup.sh                    what a run needs: requirements.lock
#   scripts/setup.sh lint               and what tests and checks need: requirements-dev.lock
#   scripts/setup.sh dev                and the machine code of runs, made now
#   scripts/setup.sh lock [--upgrade]   make both locks from pyproject.toml
#
# Exit 0 ready, 1 an installation failed, 2 something to install first. Python is $PYTHON if set,
# else 3.11 if there is one, else the oldest newer one. Packages come by uv, from PATH or as a wheel
# of the lock, which takes a tenth of pip's time; by pip where there is none or it fails.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly LOG=.venv/setup.log
readonly PIP=(.venv/bin/python -m pip --disable-pip-version-check --no-input)

# What a Python is, one fact per line; older Pythons than 3 fail on it, which is an answer too.
readonly PROBE='
import platform, sys
try:
    import ensurepip, venv
    pip = bool(ensurepip.version())
except Exception:
    pip = False
print(sys.version_info[1] if sys.implementation.name == "cpython" else 0, platform.python_version(),
      int(pip), sys._base_executable, sep="\n")
'

say() { printf 'setup: %s\n' "$*" >&2; }

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
  [[ ${#facts[@]} == 4 ]] || return 1
  local minor=${facts[0]} pip=${facts[2]}
  ((minor >= 11)) && [[ -z ${2-} || $minor == "$2" ]] || return 1
  version=${facts[1]} python=${facts[3]}
  ((pip)) && return
  hint=${hint:-"python3.$minor-venv for the Python $version found here"}
  return 1
}

choose() { # sets python and version, or ends with what to install
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
  say "install ${hint:-"Python 3.11 or newer, with venv"}; then run this again"
  exit 2
}

# Installation ------------------------------------------------------------------------------------

logged() { # run, with all that it prints in the log only
  printf '\n$ %s\n' "$*" >>"$LOG"
  "$@" >>"$LOG" 2>&1
}

failed() {
  say "failed; the last lines of $LOG:"
  tail -n 12 "$LOG" | sed 's/^/  | /' >&2
  say "if the network or the disk was the reason, the same command starts afresh"
  exit 1
}

pinned() { awk -v "start=$1==" '/^[^ #]/ { on = index($0, start) == 1 } on' "$2"; } # a lock's part

find_uv() { # sets uv, or leaves it empty where only pip is to be had
  uv=$(type -P uv || type -P .venv/bin/uv) && return
  pinned uv requirements-dev.lock >.venv/uv.lock
  if logged "${PIP[@]}" install --only-binary :all: --require-hashes -r .venv/uv.lock; then
    uv=.venv/bin/uv
  fi
}

add() { # install into .venv
  [[ $uv != unsought ]] || find_uv
  if [[ -n $uv ]]; then
    if logged "$uv" pip install --python .venv/bin/python "$@"; then return; fi
    say "uv failed, as $LOG tells; going on with pip, which takes longer"
    uv=''
  fi
  logged "${PIP[@]}" install --progress-bar off --use-pep517 "$@" || failed
}

install_environment() {
  choose
  say "installing what a run needs into .venv, with Python $version, once: about half a minute"
  rm -f .venv/.environment # before anything else, as the removal itself may be interrupted
  rm -rf .venv
  mkdir .venv
  logged "$python" -m venv .venv || failed
  printf '%s\n' "$python" >.venv/.python
  # What has to be built is built with the setuptools of the lock, not with the newest one.
  pinned setuptools requirements.lock >.venv/setuptools.lock
  add --require-hashes -r .venv/setuptools.lock
  add --require-hashes --no-build-isolation -r requirements.lock
}

install_project() {
  add --no-deps --no-build-isolation --editable .
  if ! logged "${PIP[@]}" check; then
    say "requirements.lock does not fit pyproject.toml: \`make lock\` renews it"
    failed
  fi
}

install_engine() { # the machine code of runs, which would else be made by the first of them
  logged .venv/bin/python -m vsr_core.run || failed
}

install_dev() {
  say "adding what tests and checks need to .venv"
  add --no-deps --require-hashes -r requirements-dev.lock
}

# Steps -------------------------------------------------------------------------------------------

state() { # what a step was done for; written when it is done
  case $1 in
    environment) printf '%s %s\n' "$(cksum <requirements.lock)" "$PWD" ;;
    project) cksum <pyproject.toml ;;
    engine) find vsr_core requirements.lock -name '*.py' -o -name '*.lock' | LC_ALL=C sort | xargs cat | cksum ;;
    dev) cksum <requirements-dev.lock ;;
  esac
}

same_python() { # or none is asked for, or what is asked for will not do
  [[ -z ${PYTHON-} ]] || ! suits "$PYTHON" || [[ $python == "$(<.venv/.python)" ]]
}

has() {
  [[ -x .venv/bin/python && -f .venv/.$1 && $(<".venv/.$1") == "$(state "$1")" ]] || return 1
  [[ $1 != environment ]] || same_python
}

ready() {
  local step
  for step in "${steps[@]}"; do has "$step" || return 1; done
}

take() { # do a step, unless it is done
  has "$1" && return
  "install_$1"
  state "$1" >".venv/.$1.new"
  mv ".venv/.$1.new" ".venv/.$1"
}

lock() {
  local uv compile known=() name
  if ! uv=$(type -P uv || type -P .venv/bin/uv); then
    choose
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    "$python" -m venv "$folder"
    pinned uv requirements-dev.lock >"$folder/uv.lock"
    "$folder/bin/python" -m pip install --quiet --require-hashes -r "$folder/uv.lock"
    uv=$folder/bin/uv
  fi
  compile=("$uv" pip compile --universal --python-version 3.11 --generate-hashes --quiet
    --custom-compile-command 'make lock' "$@" pyproject.toml)
  "${compile[@]}" --group setup --output-file requirements.lock
  # The second lock holds only what the first does not.
  for name in $(sed -n 's/^\([a-z0-9][^=]*\)==.*/\1/p' requirements.lock | sort -u); do
    known+=(--no-emit-package "$name")
  done
  "${compile[@]}" --group dev --constraint requirements.lock "${known[@]}" \
    --output-file requirements-dev.lock
}

# Packages of other installations (a sourced ROS, say) must not pass for those of the lock.
unset PYTHONHOME PYTHONPATH PYTHONDONTWRITEBYTECODE PIP_USER PIP_TARGET PIP_PREFIX
uv=unsought
case ${1-} in
  lock) lock "${@:2}" && exit ;;
  lint) steps=(environment project dev) ;;
  dev) steps=(environment project dev engine) ;;
  *) steps=(environment project engine) ;;
esac
ready && exit

if [[ ! -w . || (-e .venv && ! -w .venv) ]]; then
  say "$PWD cannot be written to, so .venv cannot be made there; copy it to a folder of your own"
  exit 2
fi

# One at a time; where there is no flock, two at once are the user's to avoid.
if command -v flock >/dev/null; then
  exec 9<scripts/setup.sh
  flock --nonblock 9 || { say "another setup is under way; waiting for it" && flock 9; } || true
fi
trap 'say "stopped; the next run starts afresh"; exit 130' INT TERM
ready && exit
for step in "${steps[@]}"; do take "$step"; done
say "done in $SECONDS s"
