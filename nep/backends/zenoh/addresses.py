"""Network addresses of this back end (values of a node's `master`), and sessions opened at them.

    local, local/NAME         nodes of this user on this computer, over loopback
    tcp/HOST:7447,tls/...     a zenoh router or peer: the node connects to it and doesn't listen
    FILE.json5                a zenoh configuration file: TLS, access control, other modes

`validate_address` validates an address, `open_session_at` opens a session at it.
"""

from __future__ import annotations

import json
import os
import re
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nep.backends.zenoh.library import load_zenoh, open_session
from nep.backends.zenoh.rendezvous import Rendezvous, SessionEntry, free_port
from nep.errors import NepError, WrongTypeError
from nep.i18n import _
from nep.system.addresses import LOOPBACK
from nep.system.descriptors import check_free_descriptors

CONFIG_VARIABLE = "NEP_ZENOH_CONFIG"
"""Name of the environment variable with the default network address, in any form that `master` accepts."""
_LOCAL_ADDRESS = re.compile(r"local(?:/([\w.-]{1,100}))?", re.ASCII)
_ENDPOINT = re.compile(r"(?:tcp|tls|quic|udp|ws|unixsock-stream|serial|vsock)/[^\s,]{1,400}", re.ASCII)
_SECURE_PROTOCOL = re.compile(r"\b(?:tls|quic)/")
_FILE_SUFFIXES = (".json5", ".json", ".yaml", ".yml")
_DEFAULT_LISTEN_ENDPOINTS = {"router": ["tcp/[::]:7447"], "peer": ["tcp/[::]:0"]}
_MESSAGE_WAIT_S = 0.05
"""Time in seconds that a message, or the first fragment of a large one, waits for room in a connection.

zenoh's default of one millisecond is too short for a busy computer, where zenoh's thread may not run
within this time. A suspended subscriber delays the publisher once by this time; after that, zenoh drops
messages immediately until there is room again.
"""
_FRAGMENTS_WAIT_S = 1.0
"""Total time in seconds that the fragments of a large message wait for room before it is dropped.

zenoh's default of 50 ms is too short to send 8 MB over a link of 100 MB/s, or on a busy computer.
"""
_MAX_TIMEOUT_S = 10**6
_FDS_PER_SESSION = 16
_FDS_PER_PEER = 2
_PORT_ATTEMPTS = 5
_CONNECT_TIMEOUT_S, _CONNECT_POLL_S = 1.0, 0.005
_SOURCE_LOCATION = re.compile(r" at /\S+\.rs:\d+\.?")


@dataclass(frozen=True)
class OpenSession:
    """Open session, with its entry in the rendezvous.

    Attributes:
        session: Session of zenoh.
        rendezvous: Rendezvous of a local network; None for other networks.
        entry: Entry of this session in `rendezvous`, or None.
        endpoints: Endpoints to close in a forked child process (`nep.system.forks.close_in_child`).
        routers: Endpoints of routers, of which at least one must be connected to reach other nodes.
            Empty for peers.
    """

    session: Any
    rendezvous: Rendezvous | None = None
    entry: SessionEntry | None = None
    endpoints: tuple[str, ...] = ()
    routers: tuple[str, ...] = ()

    @property
    def is_router_lost(self) -> bool:
        """True if a router is needed and none is connected. zenoh reconnects automatically."""
        info = self.session.info
        return bool(self.routers) and not (info.routers_zid() or info.peers_zid())

    def unregister(self) -> None:
        """Remove the session from the rendezvous, so that no other session connects to it any more."""
        if self.rendezvous is not None and self.entry is not None:
            self.rendezvous.remove(self.entry)


def validate_address(master: str | None = None) -> str:
    """Validate a network address and return it.

    Args:
        master: Network address; None or "" selects $NEP_ZENOH_CONFIG, or "local" if the variable is not
            set.

    Raises:
        NepError: The address is invalid.
        WrongTypeError: `master` isn't a string.
    """
    if master is not None and not isinstance(master, str):
        raise WrongTypeError(
            _("a zenoh address must be a 'str', not a '{kind}'").format(kind=type(master).__name__)
        )
    address = master or os.environ.get(CONFIG_VARIABLE, "") or "local"
    if _LOCAL_ADDRESS.fullmatch(address) or address.endswith(_FILE_SUFFIXES) or _parse_endpoints(address):
        return address
    raise NepError(
        _(
            "'{place}' isn't a zenoh address; use 'local', an endpoint such as 'tcp/192.168.1.5:7447', "
            "or a zenoh configuration file such as 'zenoh.json5'"
        ).format(place=address)
    )


def _parse_endpoints(address: str) -> tuple[str, ...]:
    # Returns () if the address isn't a list of endpoints.
    endpoints = tuple(endpoint.strip() for endpoint in address.split(","))
    return endpoints if all(map(_ENDPOINT.fullmatch, endpoints)) else ()


def open_session_at(address: str, wait_s: float | None) -> OpenSession:
    """Open a session at a network address. Raises `NepError` on failure.

    Args:
        address: Network address returned by `validate_address`.
        wait_s: Seconds to wait for a router; None waits forever.
    """
    match = _LOCAL_ADDRESS.fullmatch(address)
    if match is not None:
        return _open_local(match.group(1) or "nodes")
    check_free_descriptors(_FDS_PER_SESSION, "a session of zenoh")
    endpoints = _parse_endpoints(address)
    if not endpoints:
        return OpenSession(_open_from_file(Path(address)))
    settings: dict[str, object] = {
        "mode": "client",
        "connect": {
            "endpoints": list(endpoints),
            "timeout_ms": round(1000 * min(_MAX_TIMEOUT_S, _MAX_TIMEOUT_S if wait_s is None else wait_s)),
        },
        "scouting": {"multicast": {"enabled": False}},
    }
    tcp_endpoints = tuple(
        f"tcp://{each.removeprefix('tcp/')}" for each in endpoints if each.startswith("tcp/")
    )
    return OpenSession(
        _open_session(_create_config(settings), address), endpoints=tcp_endpoints, routers=endpoints
    )


def _open_local(name: str) -> OpenSession:
    rendezvous = Rendezvous(name)
    with rendezvous.exclusive():
        other_ports = [entry.port for entry in rendezvous.entries()]
        check_free_descriptors(_FDS_PER_SESSION + _FDS_PER_PEER * len(other_ports), "a session of zenoh")
        port, session = _open_at_free_port(other_ports)
        entry = rendezvous.add(port)
    endpoints = tuple(f"tcp://{LOOPBACK}:{each}" for each in (port, *other_ports))
    return OpenSession(session, rendezvous, entry, endpoints)


def _open_at_free_port(other_ports: list[int]) -> tuple[int, Any]:
    # Another program may bind the port before zenoh does; then try another port.
    for remaining_attempts in reversed(range(_PORT_ATTEMPTS)):
        port = free_port()
        settings: dict[str, object] = {
            "mode": "peer",
            "listen": {"endpoints": [f"tcp/{LOOPBACK}:{port}"], "timeout_ms": 0, "exit_on_failure": True},
            "connect": {
                "endpoints": [f"tcp/{LOOPBACK}:{each}" for each in other_ports],
                "timeout_ms": 0,
                "exit_on_failure": False,
            },
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "open": {"return_conditions": {"connect_scouted": False, "declares": True}},
        }
        try:
            return port, open_session(_create_config(settings))
        except load_zenoh().ZError as error:
            if not remaining_attempts:
                raise NepError(
                    _("zenoh can't listen at '{host}': {error}").format(
                        host=LOOPBACK, error=_error_text(error)
                    )
                ) from error
    raise AssertionError


def _open_from_file(path: Path) -> Any:  # noqa: ANN401 - zenoh is not typed
    # Peers connect in the background, so wait a moment for them.
    config = _load_config(path)
    session = _open_session(config, str(path))
    if json.loads(config.get_json("connect/endpoints")):
        pause, deadline = threading.Event(), time.monotonic() + _CONNECT_TIMEOUT_S
        while time.monotonic() < deadline and not (session.info.routers_zid() or session.info.peers_zid()):
            pause.wait(_CONNECT_POLL_S)
    return session


def _create_config(settings: dict[str, object]) -> Any:  # noqa: ANN401 - zenoh is not typed
    drop = {
        "wait_before_drop": round(1e6 * _MESSAGE_WAIT_S),
        "max_wait_before_drop_fragments": round(1e6 * _FRAGMENTS_WAIT_S),
    }
    queue = {"queue": {"congestion_control": {"drop": drop}}}
    return load_zenoh().Config.from_json5(json.dumps({**settings, "transport": {"link": {"tx": queue}}}))


def _load_config(path: Path) -> Any:  # noqa: ANN401 - zenoh is not typed
    # Defaults for options that the file leaves out: loopback, no multicast. Raises `NepError`.
    try:
        config = load_zenoh().Config.from_file(str(path.expanduser()))
    except load_zenoh().ZError as error:
        raise NepError(
            _("'{path}' isn't a zenoh configuration: {error}; see DEFAULT_CONFIG.json5 of zenoh").format(
                path=path, error=_error_text(error)
            )
        ) from error
    if json.loads(config.get_json("listen/endpoints")) == _DEFAULT_LISTEN_ENDPOINTS:
        ports = {mode: [f"tcp/{LOOPBACK}:{port}"] for mode, port in (("router", 7447), ("peer", 0))}
        config.insert_json5("listen/endpoints", json.dumps(ports))
    if json.loads(config.get_json("scouting/multicast/enabled")) is None:
        config.insert_json5("scouting/multicast/enabled", "false")
    return config


def _open_session(config: Any, address: str) -> Any:  # noqa: ANN401 - zenoh is not typed
    try:
        return open_session(config)
    except load_zenoh().ZError as error:
        message = _error_text(error)
        if _SECURE_PROTOCOL.search(message) is not None:
            reason = _(
                "zenoh can't open a session at '{place}': {error}; check that a router is running there "
                "and that each side trusts the certificate of the other"
            )
        else:
            reason = _(
                "zenoh can't open a session at '{place}': {error}; check that a router is running there "
                "and that it allows this connection"
            )
        raise NepError(reason.format(place=address, error=message)) from error


def _error_text(error: Exception) -> str:
    # Removes the source location from zenoh's message.
    return _SOURCE_LOCATION.sub("", str(error)).strip().rstrip(".")
