"""ViewPacker: the form of graphs on the wire, made from what is the same as in the one before."""

from __future__ import annotations

import msgpack  # type: ignore[import-untyped]

from nep.messages.packing import pack_surely, saturated
from nep.protocol.encoding import encode_answer
from nep.protocol.graph_view import NodeInfo, TopicInfo
from nep.protocol.plain import write
from nep.protocol.requests import Push, Reply, Seen

__all__ = ["ViewPacker"]


class ViewPacker:
    """Keeps the bytes of each node and topic as long as its value is the same."""

    def __init__(self) -> None:
        self._pack = msgpack.Packer(use_bin_type=True, unicode_errors="replace", default=_plain).pack
        self._parts: dict[str, tuple[NodeInfo | TopicInfo, bytes]] = {}

    def body(self, answer: Reply | Push, call: int) -> bytes:
        """The body of `answer`: means the same as that of `nep.protocol.encoding.encode_answer`."""
        return self._seen(answer, call) if isinstance(answer, Seen) else encode_answer(answer, call)

    def _seen(self, answer: Seen, call: int) -> bytes:
        view = answer.view
        header = msgpack.Packer().pack_map_header
        rest = {
            "epoch": view.epoch,
            "revision": view.revision,
            "alerts": write(view.alerts),
            "listens": view.listens,
        }
        nodes = [self._part(f"n{key}", key, node) for key, node in view.nodes.items()]
        topics = [self._part(f"t{key}", key, topic) for key, topic in view.topics.items()]
        if len(self._parts) > 2 * (len(nodes) + len(topics)) + 100:
            self._parts.clear()  # many have gone
        return b"".join(
            (
                header(3),
                *map(pack_surely, ("is", "seen", "re", call, "what")),
                header(3),
                *map(pack_surely, ("epoch", answer.epoch, "revision", answer.revision, "view")),
                header(len(rest) + 2),
                *(pack_surely(key) + pack_surely(item) for key, item in rest.items()),
                pack_surely("nodes"),
                header(len(nodes)),
                *nodes,
                pack_surely("topics"),
                header(len(topics)),
                *topics,
            )
        )

    def _part(self, name: str, key: str, value: NodeInfo | TopicInfo) -> bytes:
        kept = self._parts.get(name)
        # A topic that has not changed is the same value; comparing two that are not takes as long as packing.
        if kept is not None and (kept[0] is value or (isinstance(value, NodeInfo) and kept[0] == value)):
            return kept[1]
        # All fields, also those that have their default: to look for these takes longer.
        packed: bytes = self._pack(key) + self._pack(vars(value))
        self._parts[name] = (value, packed)
        return packed


def _plain(value: object) -> object:
    """What msgpack does not know: our own values, and numbers beyond its own."""
    return saturated(value) if isinstance(value, int) else vars(value)
