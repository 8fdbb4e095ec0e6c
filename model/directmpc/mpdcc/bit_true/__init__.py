"""Bit-true twins of ``mpdcc_core``: one module for each variant of the explorer."""
