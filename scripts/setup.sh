#!/usr/bin/env bash
# Sets up what the project runs on: system tools (apt) and pinned Python packages in .venv.
# Says on stderr what it installs, in which version and what for; silent about what is there.
#
# PYTHON, GHDL, VERILATOR, YOSYS, NEXTPNR and YICES may name commands of your own. Such a command is
# checked and used, and nothing is installed in its place. CXX may name another compiler.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$root/.venv"
stamp="$venv/.ready"

say() { printf 'setup: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }
exists() { command -v "$1" >/dev/null 2>&1; }

# Runs a command that is silent, and says every ten seconds that it goes on. Its exit code is the command's.
patiently() {
  local pulse status=0
  (while sleep 10 >/dev/null 2>&1; do say "  still at it, after $SECONDS s"; done) &
  pulse=$!
  "$@" || status=$?
  kill "$pulse" 2>/dev/null || true
  wait "$pulse" 2>/dev/null || true
  return "$status"
}

# Through a link, everything below would be written into the environment of another tree.
[ ! -L "$venv" ] || die "$venv is a symbolic link; remove it, this tree needs an environment of its own"

# ---------------------------------------------------------------------------------------------
# apt
# ---------------------------------------------------------------------------------------------

# What a package is for, printed beside its version.
purpose() {
  case "$1" in
    ghdl) echo "simulates the VHDL and converts it to Verilog" ;;
    verilator) echo "simulates the converted netlists" ;;
    make) echo "runs the commands of this project and builds Verilator's models" ;;
    g++) echo "compiles Verilator's models" ;;
    python3) echo "runs the models, the tools and the tests" ;;
    *-venv) echo "makes .venv, where the Python packages go" ;;
    libpython*-dev) echo "cocotb is built from its sources here" ;;
    libpython*) echo "cocotb runs Python inside the simulator" ;;
  esac
}

# Runs a command as root, or fails when nobody here may.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif exists sudo; then
    sudo "$@"
  else
    return 1
  fi
}

# Version that apt would install; nothing when its lists do not hold the package.
candidate() {
  LC_ALL=C apt-cache policy "$1" 2>/dev/null | sed -n 's/^ *Candidate: //p' | grep -vFx '(none)' || true
}

# Installs Debian packages, or says which ones somebody has to install.
apt_install() {
  local packages=("$@") package
  local advice="please install: ${packages[*]} (apt-get install ${packages[*]}), then run this again"
  exists apt-get || die "$advice"
  if [ "$(id -u)" -ne 0 ] && ! exists sudo; then
    die "neither root nor sudo: $advice"
  fi
  # The lists of a fresh container are absent.
  for package in "${packages[@]}"; do
    if [ -z "$(candidate "$package")" ]; then
      say "apt's lists lack $package: apt-get update"
      as_root apt-get update -qq >&2 || say "apt-get update failed, trying to install all the same"
      break
    fi
  done
  say "installing with apt:"
  for package in "${packages[@]}"; do
    say "$(printf '  %-16s %-22s %s' "$package" "$(candidate "$package")" "$(purpose "$package")")"
  done
  local install=(env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq -oDpkg::Use-Pty=0 --no-install-recommends)
  if ! patiently as_root "${install[@]}" "${packages[@]}" >&2; then
    say "that failed; trying once more with fresh lists"
    as_root apt-get update -qq >&2 || true
    patiently as_root "${install[@]}" "${packages[@]}" >&2 || die "$advice"
  fi
}

# ---------------------------------------------------------------------------------------------
# System tools
# ---------------------------------------------------------------------------------------------

# $(given VARIABLE): the command that somebody chose with VARIABLE, without its arguments.
given() { local words; read -ra words <<<"${!1:-}" || true; printf '%s' "${words[0]:-}"; }

# need VARIABLE DEFAULT PACKAGE: the command that will be used is there, or its package is noted.
# Only the default can be installed: another name is somebody's own choice.
missing=()
need() {
  local command
  command="$(given "$1")"
  command="${command:-$2}"
  exists "$command" && return
  [ "$command" = "$2" ] || die "$1=${!1}: there is no command '$command'"
  [ -n "$3" ] || die "$1=${!1}: there is no command '$command'; leave $1 out for the project's own"
  missing+=("$3")
}

need GHDL ghdl ghdl
need VERILATOR verilator verilator
need MAKE make make
need CXX g++ g++
[ -z "$(given YOSYS)" ] || need YOSYS "$(given YOSYS)" ""
[ -z "$(given NEXTPNR)" ] || need NEXTPNR "$(given NEXTPNR)" ""
[ -z "$(given YICES)" ] || need YICES "$(given YICES)" ""
[ ${#missing[@]} -eq 0 ] || apt_install "${missing[@]}"

# check VARIABLE DEFAULT NAME MAJOR: it runs, says that it is NAME, and is version MAJOR or newer.
check() {
  local words text version
  read -ra words <<<"${!1:-$2}"
  text="$("${words[@]}" --version 2>&1 | head -n 1)" || text="${text:-nothing}"
  version="$(sed -nE "s/^$3 ([0-9]+)[^0-9].*/\1/p" <<<"$text")"
  [ -n "$version" ] && [ "$version" -ge "$4" ] ||
    die "$1: '${words[*]} --version' says '$text'; $3 $4 or newer is needed"
}
check GHDL ghdl GHDL 2
check VERILATOR verilator Verilator 5

# ---------------------------------------------------------------------------------------------
# Python
# ---------------------------------------------------------------------------------------------

is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }

# A PYTHON of one's own is taken at its word; else the first one found that will do.
find_python() {
  if [ "${PYTHON:-python3}" != python3 ]; then
    exists "$PYTHON" || die "PYTHON=$PYTHON: there is no command '$PYTHON'"
    is_new_enough "$PYTHON" || die "PYTHON=$PYTHON is older than Python 3.11, or does not run"
    python="$PYTHON"
    return
  fi
  for python in python3 python3.13 python3.12 python3.11; do
    if exists "$python" && is_new_enough "$python"; then
      return
    fi
  done
  exists python3 && die "Python 3.11 or newer is needed: set PYTHON to one"
  apt_install python3 python3-venv
  python=python3
  is_new_enough python3 || die "this system's Python is older than 3.11: set PYTHON to a newer one"
}

# $(of_python FORMAT): FORMAT with major and minor version of the Python in use.
of_python() { "$python" -c 'import sys; print(sys.argv[1] % sys.version_info[:2])' "$1"; }

if [ -x "$venv/bin/python" ] && "$venv/bin/python" -c '' >/dev/null 2>&1; then
  python="$venv/bin/python"
else
  find_python
  if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
    # Debian splits venv off; a Python of another origin has its own package for it.
    apt_install "$(of_python 'python%d.%d-venv')"
  fi
  "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 || die "$python has no venv module"
  say "creating .venv with $("$python" --version)"
  rm -rf "$venv"
  "$python" -m venv "$venv" >&2 || die "could not create $venv"
  python="$venv/bin/python"
fi

# The packages of requirements.txt: those with a comment by name, the others by their number.
say_requirements() {
  local listed
  listed="$(sed -nE 's/^([A-Za-z0-9_.-]+)==([^ ;]+)[^#]*# *(.*)$/\1 \2 \3/p' "$root/requirements.txt")"
  while read -r name version text; do
    [ -z "$name" ] || say "$(printf '  %-22s %-18s %s' "$name" "$version" "$text")"
  done <<<"$listed"
  say "  and $(grep -cE '^[A-Za-z0-9_.-]+==[^ #]+ *$' "$root/requirements.txt" || true) that these need"
}

# The stamp holds what the environment was made from, so that a change of either is noticed.
# Files of packages are compared with their hashes: locks/, which `make lock` writes.
locks="$root/locks"
# What is tried is amd64. Elsewhere cocotb is built from its sources.
machine="$(uname -m)"
case "$machine" in
  x86_64 | amd64) headers= ;;
  *) headers=yes; say "the project is tried on amd64; this is $machine, where library and host work and the rest may not" ;;
esac
want="$(cat "$locks/requirements.txt" "$locks/requirements-proofs.txt" <(printf '%s\n' "$root") <("$python" --version) | sha256sum | cut -d' ' -f1)"
if [ ! -f "$stamp" ] || [ "$(cat "$stamp")" != "$want" ]; then
  if [ -n "$headers" ] && ! "$python" -c 'import os, sysconfig as s; os.stat(s.get_path("include") + "/Python.h")' 2>/dev/null; then
    apt_install "$(of_python 'libpython%d.%d-dev')"
  fi
  say "installing the Python packages of requirements.txt into .venv:"
  say_requirements
  # uv is much quicker than pip, which gets it. What pip's settings say of the index, uv has to be told.
  pip_install() {
    "$python" -m pip install --quiet --disable-pip-version-check --no-input --require-hashes -r "$1" >&2
  }
  uv_install() {
    local index
    pip_install <(sed -n '/^uv==/,/[^\\]$/p' "$locks/requirements.txt") || return
    index="$("$python" -m pip config get global.index-url 2>/dev/null)" || index="${PIP_INDEX_URL:-}"
    UV_DEFAULT_INDEX="${UV_DEFAULT_INDEX:-$index}" "$python" -m uv pip install --quiet --system-certs \
      --python "$python" --require-hashes -r "$locks/requirements.txt" >&2
  }
  if ! patiently uv_install; then
    say "that failed; trying once more, with pip"
    patiently pip_install "$locks/requirements.txt" || die "pip could not install requirements.txt"
  fi
  # Optional: on some machines there is no such package.
  if [ -z "$(given YICES)" ]; then
    pip_install "$locks/requirements-proofs.txt" 2>/dev/null ||
      say "no package of Yices for $machine: 'make prove' and tests of proofs need one of your own (YICES=yices-smt2)"
  fi
  # The model and the scripts are imported from the tree itself: an edit needs no reinstallation.
  site="$("$python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')"
  printf '%s\n' "$root/model" "$root" >"$site/directmpc.pth"
fi

# command_of NAME MODULE: a program of the project, from any folder. It finds the clone by its own place, so a clone may be moved.
command_of() {
  cat >"$venv/bin/$1" <<END
#!/bin/sh
# What 'python -m $2' is in the folder of the directmpc project. setup.sh writes this file.
here="\$(readlink -f -- "\$0")" && root="\${here%/.venv/bin/$1}"
if [ "\$root" = "\$here" ] || [ ! -f "\$root/scripts/__main__.py" ]; then
  echo "$1: \$here is not in a clone of directmpc; run .venv/bin/$1 of a clone, after 'make setup' there" >&2
  exit 2
fi
# -P: a folder 'scripts' of whoever calls is another one
PYTHONPATH="\$root/model:\$root\${PYTHONPATH:+:\$PYTHONPATH}" exec "\$root/.venv/bin/python" -P -m $2 "\$@"
END
  chmod +x "$venv/bin/$1"
}
command_of directmpc scripts
command_of directmpc-host directmpc.host

# cocotb embeds Python into the simulator and so needs its shared library, which Debian splits off too.
if ! "$python" -c 'import sys, find_libpython; sys.exit(not find_libpython.find_libpython())' 2>/dev/null; then
  apt_install "$(of_python 'libpython%d.%d')"
fi

printf '%s\n' "$want" >"$stamp"
say "ready"
