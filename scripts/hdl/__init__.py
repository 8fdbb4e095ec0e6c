"""The design as VHDL: sources, conversion, simulators, clocks, and the stimuli of simulations."""
