"""Address of the ROS master. A separate module without dependencies, because every nep node imports it."""

from __future__ import annotations

import os
from urllib.parse import urlsplit

from nep.errors import NepError
from nep.i18n import _
from nep.system.addresses import check_host, host_of
from nep.text import quotable

_DEFAULT_PORT = 11311


def ros_master_address(address: str | None) -> str:
    """Return the ROS master's address as `HOST:PORT`.

    Args:
        address: `HOST:PORT` or `http://HOST:PORT`; the port defaults to 11311. None selects $ROS_MASTER_URI,
            or 127.0.0.1:11311 if the variable is not set.

    Raises:
        NepError: The address is invalid.
    """
    text = address or os.environ.get("ROS_MASTER_URI") or f"127.0.0.1:{_DEFAULT_PORT}"
    if not isinstance(text, str):
        raise NepError(
            _("an address must be a 'str' such as '{example}'").format(example=f"127.0.0.1:{_DEFAULT_PORT}")
        )
    try:
        parts = urlsplit(text if "://" in text else f"http://{text}")
        host, port = parts.hostname, _DEFAULT_PORT if parts.port is None else parts.port
    except ValueError:
        host, port = None, 0
    if not host or not port:
        raise NepError(
            _("'{chosen}' isn't a valid address of a ROS master; use an address such as '{example}'").format(
                chosen=quotable(text), example=f"127.0.0.1:{_DEFAULT_PORT}"
            )
        )
    return f"{check_host(host)}:{port}"


def is_loopback_address(address: str) -> bool:
    """Return True if the host of an address is the loopback interface."""
    host = host_of(address)
    return host == "localhost" or host.startswith("127.")
