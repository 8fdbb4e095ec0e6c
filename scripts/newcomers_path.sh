#!/usr/bin/env bash
# Does what somebody does who meets the project for the first time, and says how long each step took.
#
#   scripts/newcomers_path.sh          in a clone
#   scripts/newcomers_path.sh WHEEL    with the wheel, on a bare Debian, as root
#
# The steps: a clone, `make run`, a drive file of one's own, a run of it that is recorded as a
# trace, the trace through the RTL, and a virtual board that the host program controls with that
# drive. With a wheel: what Debian has to bring, the wheel and FMPy by pip, the RTL of a drive as an FMU, and the first
# program of docs/fmu.md, whose end is a picture. On a bare machine:
#
#   scripts/fresh_machine.sh scripts/newcomers_path.sh
#   scripts/fresh_machine.sh --bring directmpc-...whl 'scripts/newcomers_path.sh /srv/*.whl'
#
# After each step stands what it took, and last on which system and commit. `python -m scripts newcomer` stores that and
# writes the tables of docs/installing.md; its option --wheel makes the wheel and runs the second way first. The first
# step that fails ends the script with that step's exit code. What it makes is in build/newcomer.
set -euo pipefail
wheel="${1:+$(realpath "$1")}"
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mine=build/newcomer
python=.venv/bin/python
board=

finish() { [ -z "$board" ] || kill "$board" 2>/dev/null || true; }
trap finish EXIT

# Name of a step, then its command.
step() {
  local name="$1" begin=$SECONDS
  shift
  printf 'newcomer: %s: %s\n' "$name" "$*"
  "$@"
  printf 'newcomer: took %s s: %s\n' "$((SECONDS - begin))" "$name"
}

on_a_virtual_board() {
  make --no-print-directory virtual-board ARGS="--port $mine/board" &
  board=$!
  for _ in $(seq 300); do
    [ -e "$mine/board" ] && break
    kill -0 "$board" # or it has ended
    sleep 1
  done
  "$python" -m directmpc.host --port "$mine/board" run "$mine/drive.toml" --gates --steps 400
}

in_a_clone() {
  step 'a clone' git clone --quiet . "$mine/clone"
  step '`make run`' make --no-print-directory run
  step 'a drive file' "$python" -m scripts new-drive mpdcc "$mine/drive.toml"
  step 'that drive, 400 steps, recorded' make --no-print-directory run \
    ARGS="--drive $mine/drive.toml --steps 400 --trace $mine/trace.csv"
  step 'the trace through the RTL' make --no-print-directory replay \
    DRIVE="$mine/drive.toml" IN="$mine/trace.csv" OUT="$mine/decisions.csv"
  step 'a virtual board, 400 steps with gates' on_a_virtual_board
  [ "$(wc -l < "$mine/decisions.csv")" -eq 401 ]
}

with_the_wheel() {
  export DEBIAN_FRONTEND=noninteractive
  step 'Debian: a C++ compiler, Python' sh -c \
    'apt-get -qq update && apt-get -qq install --no-install-recommends g++ python3-venv > apt.log'
  step 'pip: directmpc, FMPy' sh -c \
    "python3 -m venv venv && venv/bin/pip -q install 'directmpc[rtl,plot] @ file://$wheel' fmpy"
  step '`directmpc fmu anpc5l_6kv`' venv/bin/directmpc fmu anpc5l_6kv --out controller.fmu
  sed -n '/^```python$/,/^```$/{//!p;/^```$/q}' ../../docs/fmu.md > first.py
  step 'FMPy, a picture' venv/bin/python first.py
  [ -s picture.png ]
}

rm -rf "$mine"
mkdir -p "$mine"
if [ -z "$wheel" ]; then in_a_clone; else (cd "$mine" && with_the_wheel); fi
printf 'newcomer: all steps work: %s, %s cores, commit %s\n' \
  "$(. /etc/os-release && printf '%s' "$PRETTY_NAME")" "$(nproc)" "$(git rev-parse HEAD)"
