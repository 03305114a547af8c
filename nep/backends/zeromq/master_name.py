"""MasterName: the address behind a master's name, never looked up where sockets are served.

Asking for a name can take half a minute, and libzmq asks again in its own thread with each attempt to
connect. So a thread of its own asks, and ends; libzmq gets numbers. It asks again only while the master is
not connected.
"""

from __future__ import annotations

import ipaddress
import logging
import socket
import threading
import time
from collections.abc import Callable

from nep.errors import NepError
from nep.system.addresses import host_of

__all__ = ["MasterName", "in_numbers", "look_up"]

_logger = logging.getLogger("nep")

_AGAIN_S = 5.0
_SLICE_S = 0.1
_HERE = frozenset({"localhost", "*"})
"""Names of this computer that nobody has to be asked for; a master at "*" is reached here as well."""


def look_up(host: str) -> str:
    """The first IPv4 address of a name. May wait for long; raises `OSError`, `UnicodeError`."""
    return str(socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])


def in_numbers(address: str) -> str:
    """An address with a number as its host, asked for in the caller's thread. Raises `NepError`."""
    host = host_of(address)
    if _is_number(host):
        return address
    try:
        return f"{look_up(host)}:{address.rpartition(':')[2]}"
    except (OSError, UnicodeError) as error:
        raise NepError(
            f"no computer is called '{host}' here; look for a typing error, or write its address in numbers"
        ) from error


class MasterName:
    """The name in `address`; what is a number already is known at once. `on_change` is told a new `known`.

    `on_change` is called in the thread that asked.
    """

    def __init__(
        self, address: str, on_change: Callable[[str], None], look_up: Callable[[str], str] = look_up
    ) -> None:
        self.known = ""
        """The address with a number as its host; "" as long as nobody knows it."""
        self._host, self._port = host_of(address), address.rpartition(":")[2]
        self._on_change = on_change
        self._look_up = look_up
        self._thread: threading.Thread | None = None
        self._again_at = 0.0
        self._is_told = False
        self._answered = threading.Event()
        host = "127.0.0.1" if self._host in _HERE else self._host
        if _is_number(host):
            self.known = f"{host}:{self._port}"
            self._answered.set()

    def look(self, now: float) -> None:
        """The master is not connected: ask again, when it is a name and the last time was long ago."""
        is_asking = self._thread is not None and self._thread.is_alive()
        if _is_number(self._host) or self._host in _HERE or is_asking or now < self._again_at:
            return
        self._again_at = now + _AGAIN_S
        thread = threading.Thread(target=self._ask, name=f"nep-name-{self._host}", daemon=True)
        try:
            thread.start()
        except RuntimeError:
            return  # no thread can be had now
        self._thread = thread

    def wait(self, timeout_s: float | None) -> bool:
        """Wait until it is known, None without a limit; whether it is."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._answered.is_set():
            left = _SLICE_S if deadline is None else min(_SLICE_S, deadline - time.monotonic())
            if left <= 0.0:
                return False
            self._answered.wait(left)
        return True

    def _ask(self) -> None:
        try:
            known = f"{self._look_up(self._host)}:{self._port}"
        except (OSError, UnicodeError) as error:
            if not self._is_told:
                self._is_told = True
                _logger.info(  # who waits for the master is told by `MasterUnreachable`
                    "nobody knows the computer '%s' of the master (%s); asking again", self._host, error
                )
            return
        self._is_told = False
        if known != self.known:
            self.known = known
            self._on_change(known)
        self._answered.set()


def _is_number(host: str) -> bool:
    try:
        ipaddress.IPv4Address(host)
    except ValueError:
        return False
    return True
