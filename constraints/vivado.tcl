# Arty S7-50 in Vivado, from the netlist `make netlist BOARD=arty-s7-50` writes to build/bitstream:
#
#   make netlist BOARD=arty-s7-50 [CONTROLLER=mptc]
#   vivado -mode batch -source constraints/vivado.tcl -tclargs mpdcc
#
# This script has not been run: Vivado is not part of this project's tool chain. Ports, pins and clock
# constraints are checked by tb/tools/test_boards.py.
# Licence: Apache-2.0

set controller [expr {$argc > 0 ? [lindex $argv 0] : "mpdcc"}]
set root [file normalize [file join [file dirname [info script]] ..]]
set out [file join $root build bitstream]
set name arty-s7-50-$controller
set source [file join $out $name.v]

if {![file exists $source]} {
  puts stderr "$source is missing: make netlist BOARD=arty-s7-50 CONTROLLER=$controller"
  exit 1
}

create_project -in_memory -part xc7s50csga324-1
read_verilog $source
read_xdc [file join $root constraints/arty_s7_50.xdc]
synth_design -top board_top -part xc7s50csga324-1
opt_design
place_design
route_design
report_timing_summary -file [file join $out $name.timing.txt]
report_utilization -file [file join $out $name.utilization.txt]

if {[get_property SLACK [get_timing_paths -delay_type max -max_paths 1]] < 0} {
  puts stderr "$name: timing is not met, see $name.timing.txt"
  exit 1
}

write_bitstream -force [file join $out $name.bit]
