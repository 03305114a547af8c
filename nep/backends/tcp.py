"""Back end `tcp`: servers and clients over plain TCP sockets. Aliases: "posix", "socket", "normal".

Supports calls only, at an address that both sides set with `node.direct(ip, port)`. docs/services.md
specifies the wire format for programs in other languages.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NoReturn

from nep.backends.base import Backend, PublisherSpec, SubscriberSpec
from nep.backends.connection import Configuration, Direct
from nep.backends.services import ClientSpec, ClientTransport, ServerSpec, ServerTransport
from nep.backends.zeromq.transport import ZeromqTransport
from nep.errors import NepError
from nep.i18n import _
from nep.protocol.graph_view import GraphView


class TcpTransport(ZeromqTransport):
    """Transport for direct servers and clients on the "tcp" wire. Everything else raises `NepError`."""

    def create_publisher(self, spec: PublisherSpec) -> NoReturn:
        """Raise `NepError`, because topics aren't supported."""
        raise _unsupported_error(spec.topic)

    def create_subscriber(self, spec: SubscriberSpec) -> NoReturn:
        """Raise `NepError`, because topics aren't supported."""
        raise _unsupported_error(spec.topic)

    def create_surveyor(self, spec: ClientSpec) -> NoReturn:
        """Raise `NepError`, because surveys aren't supported."""
        raise _unsupported_error(spec.service)

    def create_server(self, spec: ServerSpec) -> ServerTransport:
        """Create a server. Raises `NepError` unless the configuration is a direct connection."""
        return super().create_server(replace(spec, configuration=_require_direct(spec.configuration)))

    def create_client(self, spec: ClientSpec) -> ClientTransport:
        """Create a client. Raises `NepError` unless the configuration is a direct connection."""
        return super().create_client(replace(spec, configuration=_require_direct(spec.configuration)))

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:  # noqa: ARG002
        """Raise `NepError`, because plain TCP has no master."""
        raise NepError(_("plain TCP has no master, so there is no list of nodes"))


def _require_direct(configuration: Configuration) -> Direct:
    if not isinstance(configuration, Direct):
        reason = _("plain TCP has no master; set the address on both sides with 'node.direct(ip, port)'")
        raise NepError(reason)
    return replace(configuration, wire="tcp")


def _unsupported_error(name: str) -> NepError:
    reason = _("plain TCP supports only servers and clients; use a node with 'zeromq' for '{name}'")
    return NepError(reason.format(name=name))


BACKEND = Backend("tcp", TcpTransport, aliases=("posix", "socket", "normal"))
