"""A converted core in Verilator against a file of transactions."""

from __future__ import annotations

import argparse
from pathlib import Path

from scripts.hdl import netlist_check
from scripts.shared import progress, tools
from scripts.shared.command import command, option


@command()
@option("top", help="entity")
@option("-g", action="append", default=[], metavar="NAME=VALUE", help="a generic")
@option("--ports", type=Path, help='JSON: {"inputs": {name: width}, "outputs": ..., "hold": []}')
@option("--vectors", type=Path, required=True, help='lines {"inputs":, "outputs":, "cycles":}')
@option("--seed", type=int, default=1, help="of inputs between transactions")
def cli(given: argparse.Namespace) -> int | None:
    generics = tools.parse_generics(given.g)
    with progress.busy(f"{given.top} in Verilator"):
        result = netlist_check.check_file(
            given.top, generics, given.vectors, given.ports, given.seed
        )
    for line in result.mismatches[:20]:
        print(line)
    print(
        f"{result.checked} transactions, {len(result.mismatches)} mismatches, "
        f"{result.clocks} clocks, "
        f"{result.clocks_per_second / 1e6:.2f} million clocks/s"
    )
    return 1 if result.mismatches else 0
