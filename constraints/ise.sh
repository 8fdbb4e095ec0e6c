#!/bin/sh
# Pipistrello (Spartan-6) or Spartan-3 Starter Kit in ISE 14.7, from the EDIF netlist that
# `make netlist BOARD=...` writes to build/bitstream:
#
#   make netlist BOARD=spartan3-starter CONTROLLER=mptc
#   sh constraints/ise.sh spartan3-starter mptc
#
# This script has not been run: ISE is not part of this project's tool chain. Ports, pins and clock
# constraints (constraints/pipistrello.ucf, constraints/spartan3_starter.ucf) are checked by
# tb/tools/test_boards.py. ISE reads no VHDL-2008, hence the netlist.
# Licence: Apache-2.0
set -eu

board=${1:?board: pipistrello or spartan3-starter}
controller=${2:-mptc}
root=$(cd "$(dirname "$0")/.." && pwd)

case $board in
  pipistrello) part=xc6slx45-csg324-3 ;;
  spartan3-starter) part=xc3s1000-ft256-4 ;;
  *) echo "ise.sh: unknown board $board" >&2; exit 2 ;;
esac

name=$board-$controller
ucf=$root/constraints/$(echo "$board" | tr - _).ucf
cd "$root/build/bitstream"
[ -f "$name.edf" ] || { echo "ise.sh: $name.edf is missing: make netlist BOARD=$board CONTROLLER=$controller" >&2; exit 1; }

ngdbuild -p "$part" -uc "$ucf" "$name.edf" "$name.ngd"
map -p "$part" -w -o "$name.map.ncd" "$name.ngd" "$name.pcf"
par -w "$name.map.ncd" "$name.ncd" "$name.pcf"
trce -e 3 "$name.ncd" "$name.pcf" -o "$name.twr"
bitgen -w "$name.ncd" "$name.bit" "$name.pcf"
