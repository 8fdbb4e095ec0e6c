"""Files that are generated from the model: VHDL packages, registers, examples, constraints."""
