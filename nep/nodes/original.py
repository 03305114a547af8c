"""Names of the original module that exist only for compatibility.

docs/original-nep.md lists all of them with their replacements.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from nep.i18n import _
from nep.nodes.node import Node
from nep.system.addresses import own_addresses

if TYPE_CHECKING:
    from typing_extensions import Self


_LOOPBACK = "127.0.0.1"
_REPLACEMENTS: Mapping[str, str] = {
    "publisher": "node.new_pub(topic, msg_type)",
    "subscriber": "node.new_sub(topic, msg_type)",
    "surveyor": "node.new_surveyor(topic, timeout)",
    "respondent": "node.new_respondent(topic)",
    "broker": "nep master",
    "nepmaster": "nep master",
    "neprun": "nep master",
    "masterRegister": "nep.node(name)",
    "printError": "node.log.error(...)",
    "logError": "node.log.error(...)",
    "getFiles": "pathlib.Path(folder).iterdir()",
    "getPath": "pathlib.Path.cwd()",
    "getNEPpath": "pathlib.Path.cwd()",
    "setNEPpath": "pathlib.Path.cwd()",
    "robot": "app.robots (docs/write-a-driver.md)",
}


def original_hint(name: str) -> str:
    """Return a hint that names the replacement of a name of the original module; "" for any other name."""
    replacement = _REPLACEMENTS.get(name)
    if replacement is None:
        return ""
    template = _("'{name}' of the original module is called '{instead}' here; see docs/original-nep.md")
    return template.format(name=name, instead=replacement)


class FixedServer:
    """Server at a fixed address, without a master: the original module's `server`.

        server = nep.server("127.0.0.1", 8123)
        while True:
            print(server.listen_info())
            server.send_info({"answer": 42})

    Clients are created with `nep.client`, the original module's `client`, or `node.new_client` with
    `node.direct(ip, port)`.
    """

    def __init__(
        self,
        IP: str,  # noqa: N803 - name of the original module
        port: int | str,
        transport: str = "ZMQ",
        debug: bool = True,  # noqa: ARG002 - accepted for compatibility
    ) -> None:
        """Bind `IP:port`.

        Args:
            IP: Address of this computer; "*" or "0.0.0.0" for all.
            port: Port, 1 to 65535.
            transport: "ZMQ"; or "TCP", "POSIX" or "socket" for plain TCP (docs/services.md). Clients
                must use the same transport.
            debug: Ignored.

        Raises:
            AddressInUseError: Another program uses the port.
            UnknownBackendError: There is no such transport.
        """
        self._node = Node(f"server-{port}", transport)
        try:
            self._server = self._node.new_server(f"{IP}:{port}", None, self._node.direct(IP, port))
        except BaseException:
            self._node.close()
            raise

    def listen_info(self, timeout_s: float | None = None) -> object:
        """Return the next request; None after `timeout_s` seconds (None waits without limit)."""
        return self._server.listen_info(timeout_s)

    def send_info(self, info: object) -> None:
        """Reply to the request that `listen_info` returned."""
        self._server.send_info(info)

    def close(self) -> None:
        """Release the port. Idempotent."""
        self._node.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


class FixedClient:
    """Client of a server at a fixed address, without a master: the original module's `client`.

        client = nep.client("127.0.0.1", 8123)
        client.send_info({"question": "?"})
        print(client.listen_info())

    The server is created with `nep.server`, or with `node.new_server` and `node.direct(ip, port)`.
    """

    def __init__(
        self,
        IP: str,  # noqa: N803 - name of the original module
        port: int | str,
        transport: str = "ZMQ",
        debug: bool = True,  # noqa: ARG002 - accepted for compatibility
        *,
        timeout_s: float | None = None,
    ) -> None:
        """Connect to `IP:port`; the server may start later.

        Args:
            IP: Address or host name of the server.
            port: Port, 1 to 65535.
            transport: As for `FixedServer`.
            debug: Ignored.
            timeout_s: Time limit of `listen_info` in seconds; None waits without limit, as the original does.
        """
        self._node = Node(f"client-{port}", transport)
        try:
            self._client = self._node.new_client(
                f"{IP}:{port}", self._node.direct(IP, port), timeout_s=timeout_s
            )
        except BaseException:
            self._node.close()
            raise

    def send_info(self, info: object) -> None:
        """Send a request. `listen_info` returns the reply."""
        self._client.send_info(info)

    def listen_info(self) -> object:
        """Wait for the reply to `send_info` and return it. Raises as `Client.call` does."""
        return self._client.listen_info()

    def close(self) -> None:
        """Disconnect. Idempotent."""
        self._node.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def getMyIP() -> str:  # noqa: N802 - name of the original module
    """Return an address at which other computers may reach this one; "127.0.0.1" if there is none."""
    return next((each.host for each in own_addresses()), _LOOPBACK)


def json2dict(text: str | bytes) -> object:
    """Parse JSON text, as `json.loads` does."""
    value: object = json.loads(text)
    return value


def dict2json(value: object) -> str:
    """Return `value` as JSON text, as `json.dumps` does."""
    return json.dumps(value)


def read_json(json_file: str | Path) -> object:
    """Parse a JSON file in UTF-8.

    Raises `OSError` if the file can't be read, and `ValueError` if it isn't valid JSON.
    """
    value: object = json.loads(Path(json_file).read_text("utf-8-sig"))
    return value
