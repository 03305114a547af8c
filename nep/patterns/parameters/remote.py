"""Parameters of another node. Opened by `Node.parameters_of`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from nep.errors import NepError, RequestRefusedError, did_you_mean
from nep.i18n import _
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.patterns.services.client import Client
from nep.protocol.graph_view import GraphView
from nep.text import bounded_str, escaped

if TYPE_CHECKING:
    from typing_extensions import Self


class RemoteParameters:
    """Client of another node's parameters. Usable as a context manager.

        with node.parameters_of("camera") as parameters:
            parameters.set("exposure", 20)

    Opened by `Node.parameters_of`.
    """

    def __init__(self, client: Client) -> None:
        self._client = client

    def list(self) -> tuple[Mapping[str, object], ...]:
        """Return all parameters as maps.

        The keys are name, value, type, default, description, min, max, choices and read_only.

        Raises the exceptions of `Client.call`.
        """
        return self._request({})

    def get(self, name: str) -> object:
        """Return the value of a parameter.

        Raises:
            NepError: The name is unknown, or the call failed as `Client.call` describes.
        """
        entries = {bounded_str(each.get("name")): each for each in self.list()}
        if name not in entries:
            hint = did_you_mean(name, tuple(entries)) if entries else _("the node has no parameters")
            raise NepError(_("unknown parameter '{name}'; {said}").format(name=escaped(name), said=hint))
        return entries[name].get("value")

    def set(self, name: str, value: object) -> None:
        """Set a parameter.

        Raises:
            RequestRefusedError: The node rejected the value; the reason is its message.
            NepError: The call failed as `Client.call` describes.
        """
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, object]) -> None:
        """Set several parameters atomically. Raises the exceptions of `set`."""
        self._request({"set": dict(values)})

    def _request(self, request: Mapping[str, object]) -> tuple[Mapping[str, object], ...]:
        result = self._client.call(request)
        reply = result if isinstance(result, Mapping) else {}
        if "refused" in reply:
            raise RequestRefusedError(str(reply["refused"]))
        entries = reply.get("parameters")
        return (
            tuple(each for each in entries if isinstance(each, Mapping)) if isinstance(entries, list) else ()
        )

    def close(self) -> None:
        """Close the client."""
        self._client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def node_with_parameters(graph: GraphView, name: str) -> str:
    """Return the id of the node that has parameters and the given name or id.

    Raises `NepError` if no node or more than one node matches.
    """
    names_by_id = {
        each.id: each.name for each in graph.nodes.values() if parameters_topic(each.id) in graph.services
    }
    matching_ids = [id_ for id_, node_name in names_by_id.items() if name in {id_, node_name}]
    if len(matching_ids) == 1:
        return matching_ids[0]
    if matching_ids:
        raise NepError(
            _("{count} nodes are named '{name}'; use an id: {ids}").format(
                count=len(matching_ids), name=escaped(name), ids=", ".join(sorted(matching_ids))
            )
        )
    if any(name in {each.id, each.name} for each in graph.nodes.values()):
        raise NepError(_("the node '{name}' has declared no parameters").format(name=escaped(name)))
    known_names = tuple(sorted(set(names_by_id.values())))
    hint = did_you_mean(name, known_names) if known_names else _("no node has parameters")
    raise NepError(_("no node is named '{name}'; {said}").format(name=escaped(name), said=hint))
