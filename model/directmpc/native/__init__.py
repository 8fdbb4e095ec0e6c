"""The RTL itself as a native library: a third engine beside the ideal controller and the model.

`Design` is one instance of a core or of a system. Its Verilog is converted from the VHDL and
checked against it. Verilator and a C++ compiler make a shared library of it (`library`), with the C
interface of design.h. Instances share nothing.
"""

from directmpc.native.design import Design
from directmpc.native.library import NativeError, Port

__all__ = ["Design", "NativeError", "Port"]
