"""What the tests' vectors reach: of the VHDL, of both algorithms, of the Python library."""
