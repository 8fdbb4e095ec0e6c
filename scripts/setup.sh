#!/usr/bin/env bash
# Sets up what the project runs on: system tools (apt) and pinned Python packages in .venv.
# Says what it does on stderr; quick and silent when there is nothing to do.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$root/.venv"
stamp="$venv/.ready"
python="${PYTHON:-python3}"

say() { printf 'setup: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

# Runs a command as root, or fails when nobody here may.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif command -v sudo >/dev/null 2>&1; then
    sudo "$@"
  else
    return 1
  fi
}

# Installs Debian packages, or says which ones somebody has to install.
apt_install() {
  local packages=("$@")
  local advice="please install: ${packages[*]} (apt-get install ${packages[*]}), then run this again"
  command -v apt-get >/dev/null 2>&1 || die "$advice"
  if [ "$(id -u)" -ne 0 ] && ! command -v sudo >/dev/null 2>&1; then
    die "neither root nor sudo: $advice"
  fi
  say "installing with apt: ${packages[*]}"
  local install=(env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends)
  # Package lists may be absent (a fresh container) or stale: refresh only when the first try fails.
  if ! as_root "${install[@]}" "${packages[@]}" >&2 2>/dev/null; then
    as_root apt-get update -qq >&2 || say "apt-get update failed, trying to install all the same"
    as_root "${install[@]}" "${packages[@]}" >&2 || die "$advice"
  fi
}

is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }

# A PYTHON that is set is taken at its word; else the newest one found that will do.
find_python() {
  if [ -n "${PYTHON:-}" ] && [ "$PYTHON" != python3 ]; then
    command -v "$PYTHON" >/dev/null 2>&1 || die "PYTHON=$PYTHON does not exist"
    is_new_enough "$PYTHON" || die "PYTHON=$PYTHON is older than Python 3.11"
    return
  fi
  local candidate
  for candidate in python3 python3.13 python3.12 python3.11; do
    if command -v "$candidate" >/dev/null 2>&1 && is_new_enough "$candidate"; then
      python="$candidate"
      return
    fi
  done
  command -v python3 >/dev/null 2>&1 && die "Python 3.11 or newer is needed: set PYTHON to one"
  apt_install python3 python3-venv
  python=python3
  is_new_enough python3 || die "this system's Python is older than 3.11: set PYTHON to a newer one"
}

missing=()
command -v ghdl >/dev/null 2>&1 || [ -n "${GHDL:-}" ] || missing+=(ghdl)
command -v verilator >/dev/null 2>&1 || [ -n "${VERILATOR:-}" ] || missing+=(verilator)
command -v make >/dev/null 2>&1 || missing+=(make)
command -v g++ >/dev/null 2>&1 || [ -n "${CXX:-}" ] || missing+=(g++)
[ ${#missing[@]} -eq 0 ] || apt_install "${missing[@]}"

if [ -x "$venv/bin/python" ] && "$venv/bin/python" -c '' >/dev/null 2>&1; then
  python="$venv/bin/python"
else
  find_python
  if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
    # Debian splits venv off; a Python of another origin has its own package for it.
    apt_install "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
  fi
  "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 || die "$python has no venv module"
  say "creating .venv with $("$python" --version)"
  rm -rf "$venv"
  "$python" -m venv "$venv" >&2 || die "could not create $venv"
  python="$venv/bin/python"
fi

# The stamp holds what the environment was made from, so that a change of either is noticed.
want="$(cat "$root/requirements.txt" <(printf '%s\n' "$root") <("$python" --version) | sha256sum | cut -d' ' -f1)"
if [ ! -f "$stamp" ] || [ "$(cat "$stamp")" != "$want" ]; then
  say "installing the Python packages of requirements.txt into .venv"
  pip_install() {
    "$python" -m pip install --quiet --disable-pip-version-check --no-input -r "$root/requirements.txt" >&2
  }
  if ! pip_install; then
    say "that failed; trying once more in case it was the network"
    sleep 3
    pip_install || die "pip could not install requirements.txt"
  fi
  # The model and the scripts are imported from the tree itself: an edit needs no reinstallation.
  site="$("$python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')"
  printf '%s\n' "$root/model" "$root" >"$site/directmpc.pth"
fi

# cocotb embeds Python into the simulator and so needs its shared library, which Debian splits off too.
if ! "$python" -c 'import sys, find_libpython; sys.exit(not find_libpython.find_libpython())' 2>/dev/null; then
  apt_install "$("$python" -c 'import sys; print("libpython%d.%d" % sys.version_info[:2])')"
fi

printf '%s\n' "$want" >"$stamp"
say "ready"
