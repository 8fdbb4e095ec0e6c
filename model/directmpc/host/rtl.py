"""The board that is no board: the RTL of its top in this process, link and gate guard included.

The name ``rtl:mptc`` is a board of MPTC and its family, ``rtl:kbest`` one of K-best with 8 plans
and 12 stages, ``rtl:mpdcc`` or ``rtl:`` one of MPDCC, and
``rtl:`` before a drive the one that serves it. A host speaks to its SPI pins, a clock a bit. Time
goes on with each transaction alone, at 25 MHz, so a slow host is none for the watchdog. The native
library is built at first use (`directmpc.native.library`).
"""

from __future__ import annotations

from directmpc.api.drive_file import load_drive
from directmpc.drive_tables import DriveError
from directmpc.host.link import LinkError
from directmpc.native import Design, NativeError

BOARDS = {"mpdcc": "mpdcc_board", "kbest": "kbest_board", "mptc": "mptc_board"}
"""Controller to the native library of its board."""


class Device:
    """The pins of the RTL of a board, "mpdcc", "kbest", "mptc" or a drive; "mpdcc" if empty.

    Inputs `permit` and `steps_over_spi` are '1'. LinkError without such a board, or if its library
    cannot be built.
    """

    def __init__(self, name: str = "") -> None:
        try:
            controller = name or "mpdcc"
            if controller not in BOARDS:
                controller = load_drive(name).controller
            self.design = Design(BOARDS[controller])
        except (NativeError, DriveError, OSError) as error:
            raise LinkError(f"rtl:{name}: {error}") from None
        self.design.put("steps_over_spi", 1)

    def transfer(self, data: bytes, /) -> bytes:
        """Do a transaction; as many bytes come back."""
        return self.design.transfer(data)

    def close(self) -> None:
        """Nothing: an instance ends with its last name."""
