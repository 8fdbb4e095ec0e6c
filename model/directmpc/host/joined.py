"""A board that a scope owns: other hosts join it, and their requests go through the scope.

The name is ``scope:`` and the address that the scope has printed. What the scope refuses while it
runs the drive itself, every write but the stop and every step, raises `LinkError`.
"""

from __future__ import annotations

import json
import urllib.error
import urllib.parse
import urllib.request

from directmpc.host.link import Link, LinkError, RefusedError
from directmpc.host.protocol import Outcome, Type


class JoinedLink(Link):
    """Requests of this host, sent by a scope over its own link; `address` as it has printed it.

    `timeout` in s; LinkError if it is no address.
    """

    def __init__(self, address: str, timeout: float = 2.0) -> None:
        parts = urllib.parse.urlsplit(address)
        if parts.scheme not in ("http", "https") or not parts.netloc:
            raise LinkError(f"scope:{address}: the address that a scope prints is needed")
        self._address = parts._replace(path="/link", fragment="").geturl()
        self._timeout, self.sequence, self.strays = timeout, 0, 0

    def request(self, kind: Type, payload: bytes = b"", *, once: bool = False) -> bytes:
        """Send a request, as `Link.request` does; LinkError if the scope refuses it."""
        body = bytes([kind, once]) + payload
        try:
            with urllib.request.urlopen(self._address, body, self._timeout) as answer:
                return bytes(answer.read())
        except urllib.error.HTTPError as error:
            if error.headers.get_content_type() != "application/json":
                raise LinkError(error.read().decode(errors="replace").strip()) from None
            told = json.load(error)
            if told["outcome"] >= 0:
                raise RefusedError(kind, Outcome(told["outcome"]), told["last"]) from None
            raise LinkError(f"scope: {told['why']}") from None
        except OSError as error:
            raise LinkError(f"{self._address}: {getattr(error, 'reason', error)}") from None
