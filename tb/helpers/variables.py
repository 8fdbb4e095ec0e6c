"""Environment variables between pytest and a cocotb module.

They stand alone: a simulator that imported the runner for two names would start later, in every
bench.
"""

#: JSON object of generics and arguments, for the cocotb module.
ARGUMENTS = "DIRECTMPC_BENCH_ARGUMENTS"
#: File for what the cocotb module has counted.
RESULT = "DIRECTMPC_BENCH_RESULT"
