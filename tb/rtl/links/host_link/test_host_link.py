"""The host links in GHDL, driven by cocotbext-uart and cocotbext-spi, against the protocol's model.

Sweep: both links, each of them controlling and not.
Stimulus: requests of every type, random and at the corners of their payloads, stale and new
sequence numbers, foreign types and sizes; frames with bits turned, bytes lost, added, cut off,
replaced; a late frame, bytes without stop bit, a break, SPI transactions that end anywhere in a
request or a reply, requests during a decision, a core without an answer, both links at once.
Checks: every reply byte for byte, registers, the counters of both links, that the next frame is
served.
Timing: UART 3 Mbaud and SPI 25 MHz from a clock of 25 MHz.
Does not prove: metastability; a simulator has none. spi_slave's header says what keeps it away.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from directmpc.host import protocol
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.hdl.ghdl import BenchError, BuildError, CheckError
from scripts.hdl.sources import RTL
from scripts.measure import budgets
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

UART, SPI = 0, 1
#: Clocks from a request's end to its service, whatever the other link asks for.
LONGEST_WAIT = 256
#: Clocks from a frame that waits to the last byte of its reply, less the decision; an access is 9.
LATENCY = {
    protocol.Type.IDENTIFY: 37,
    protocol.Type.COUNTERS: 98,
    protocol.Type.READ: 37,
    protocol.Type.WRITE: 37,
    protocol.Type.STEP: 65,
}


def bench(
    case: str,
    *,
    rtl: Path = RTL,
    limit: int = 125_000,
    generics: Mapping[str, int] | None = None,
    **arguments: int,
) -> Outcome:
    return run(
        "host_link",
        generics={"LIMIT": limit, **(generics or {})},
        arguments={"seed": 1, "frames": 70, "case": case, **arguments},
        rtl=rtl,
        timeout=900,
    )


@pytest.mark.parametrize(("link", "controls"), [(UART, UART), (SPI, SPI), (SPI, UART)])
def test_every_frame_gets_the_answer_of_the_model(link: int, controls: int) -> None:
    found = bench("frames", link=link, controls=controls, frames=110)
    assert found.checks["reply"] >= 30
    for kind, longest in LATENCY.items():
        assert found.measured.get(f"latency {int(kind)}", 0) <= longest, kind.name
    assert (found.measured["decisions"] >= 5) == (link == controls)
    assert (found.covered.get("exhausted", 0) > 0) == (link == controls)


def test_mishaps_cost_one_frame() -> None:
    found = bench("mishaps", limit=4_000)
    assert found.covered["recovered"] >= 8
    # with the COUNTERS of the other link before it, a register is reached within LONGEST_WAIT
    assert found.measured["counters"] + found.measured["disable"] <= LONGEST_WAIT


@pytest.mark.parametrize(("clock", "longest"), [(100_000_000, 25_000), (25_000_000, 33_000)])
def test_a_step_over_spi_takes_its_time(clock: int, longest: int) -> None:
    """At SCK of 25 MHz with the slowest decision of SE, one explorer; ns from first to last bit."""
    found = bench(
        "exchange",
        generics={"CLOCK_HZ": clock},
        period=10**9 // clock,
        cycles=worst_cycles("fast", 1),
    )
    assert 20_000 < found.measured["exchange"] <= longest


def test_no_decision_is_given_up_too_early() -> None:
    # one explorer without a budget, the prediction, the observer and the filters before it
    longest = budgets.load().cycles["mpdcc_core"]["sese"]["worst"][0]
    longest += clocks_of("mpdcc_core", "prediction", "sese")
    # a step under way, a scaling, then the decision's own step
    longest += 2 * clocks_of("state_observer", "leakage") + clocks_of("state_observer", "scaling")
    longest += 2 * clocks_of("state_observer", "filters")
    assert longest < protocol.LONGEST_DECISION


@pytest.mark.parametrize(
    "generics",
    [
        {"CONTROLLER": 1, "STEP_WORDS": 8},
        {"CONTROLLER": 2, "STEP_WORDS": 13},
        {"CONTROLLER": 2, "STEP_WORDS": 9},
        {"CONTROLLER": 3, "STEP_WORDS": 8},
    ],
    ids=lambda generics: "-".join(map(str, generics.values())),
)
def test_words_of_the_other_controller_are_refused(generics: dict[str, int]) -> None:
    with pytest.raises((BenchError, BuildError), match="link_executor: STEP_WORDS has to be"):
        bench("frames", generics=generics, link=UART, controls=UART, frames=1)


def over_uart(rtl: Path) -> object:
    """Frames of all kinds over the UART."""
    return bench("frames", rtl=rtl, link=UART, controls=UART, frames=25)


def over_spi(rtl: Path) -> object:
    """The same over SPI."""
    return bench("frames", rtl=rtl, link=SPI, controls=SPI, frames=25)


def mishaps(rtl: Path) -> object:
    """Late, broken and cut off frames."""
    return bench("mishaps", rtl=rtl, limit=4_000, stride=7)


FAULTS: list[tuple[str, str, str, Callable[[Path], object]]] = [
    ("frame_receiver", "v.late := '1';", "null;", mishaps),
    ("frame_encoder", "not crc(7 downto 0)", "crc(7 downto 0)", over_uart),
    ("frame_sender", "if (ended = '1' and r.phase /= PHASE_IDLE) then", "if (false) then", mishaps),
    ("request_check", "behind(NUMBER_BITS - 1) and not (number_now(31) xor link)",
     "behind(NUMBER_BITS - 1)", mishaps),
    ("request_check", "link /= control and (stepping = '1' or (disables or records) = '0')",
     "stepping = '1' and link /= control", mishaps),
    ("request_check", "not (number_now(31) xor link)", "'1'", mishaps),
    ("request_check", "MPTC, 3, 9)", "MPTC, 3, 8)", over_uart),
    ("request_check", "quiet       <= '1';", "quiet       <= '0';", mishaps),
    ("reply_source", "kept_flags(FLAG_ENABLED)   <= enabled;", "null;", over_uart),
    ("reply_source", "kept_flags(FLAG_NO_ANSWER) <= no_answer;", "null;", mishaps),
    ("link_executor", "no_step  <= step_busy or parked;", "no_step  <= parked;", mishaps),
    ("link_executor", "and not (parked and not r.step_link)", "", mishaps),
    ("link_executor", "if (r.intact = '1') then", "if (true) then", mishaps),
    ("uart_receiver", "v.broken := not line;", "v.broken := '0';", mishaps),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "fault", "look"), FAULTS, ids=lambda v: str(v)[:24])
def test_a_fault_is_seen(
    name: str, text: str, fault: str, look: Callable[[Path], object], tmp_path: Path
) -> None:
    rtl = altered(tmp_path, name, text, fault)
    with pytest.raises(CheckError):
        look(rtl)
