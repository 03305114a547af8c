"""Exchange of discovery matches between nep programs.

A DDS writer's messages reach a reader only after the reader's program has discovered the writer, which
DDS doesn't report to the writer. Each program therefore publishes its matches on a topic hidden from
ROS 2: the GUID of its participant, followed by pairs of GUIDs (own endpoint, matched endpoint).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from nep.backends.ros2.library import Dds
from nep.backends.ros2.message_types import MessageTypes
from nep.backends.ros2.topics import DdsTopics, create_sample
from nep.errors import DecodeError

GID_BYTES, PREFIX_BYTES = 16, 12
"""Length of a GUID, and of the prefix shared by all GUIDs of a participant."""
_TOPIC = "nep_matches"
_TYPE = "std_msgs/msg/UInt8MultiArray"
_MAX_PAIRS, _MAX_PARTICIPANTS = 100_000, 4096


def matched_gids(entity: Any) -> frozenset[bytes]:  # noqa: ANN401 - cyclonedds is not typed
    """Return the GUIDs of the endpoints that a writer or reader is matched with."""
    if hasattr(entity, "get_matched_subscriptions"):
        handles, get_data = entity.get_matched_subscriptions(), entity.get_matched_subscription_data
    else:
        handles, get_data = entity.get_matched_publications(), entity.get_matched_publication_data
    return frozenset(data.key.bytes for data in map(get_data, handles) if data is not None)


class Matches:
    """Matches of all nep programs. See the module docstring. Guarded by the participant's lock."""

    def __init__(self, library: Dds, types: MessageTypes, topics: DdsTopics, gid: bytes) -> None:
        self._types = types
        self._gid = gid
        self._status_masks = (
            library.core.DDSStatus.PublicationMatched,
            library.core.DDSStatus.SubscriptionMatched,
        )
        self._entities: dict[bytes, Any] = {}
        self._remote_matches: dict[bytes, frozenset[bytes]] = {}
        self._published_data = b""
        self._has_changes = False
        self._confirmed_pairs: dict[bytes, frozenset[tuple[bytes, bytes]]] = {}
        self._sample_class = topics.sample_class(_TYPE)
        self._writer = topics.create_state_writer(_TOPIC, _TYPE)
        self.reader = topics.create_state_reader(_TOPIC, _TYPE)

    def add(self, entity: Any) -> None:  # noqa: ANN401 - cyclonedds is not typed
        """Add a writer or reader of this program."""
        entity.set_status_mask(self._status_masks[not hasattr(entity, "get_matched_subscriptions")])
        self._entities[entity.guid.bytes] = entity
        self._remote_matches[entity.guid.bytes] = frozenset()

    def remove(self, gid: bytes) -> None:
        """Remove a closed writer or reader."""
        self._entities.pop(gid, None)
        self._remote_matches.pop(gid, None)
        self._has_changes = True

    def publish_changes(self) -> None:
        """Publish the matches of this program if they have changed since the last call."""
        for gid, entity in self._entities.items():
            if entity.take_status():
                matched = matched_gids(entity)
                self._remote_matches[gid] = frozenset(each for each in matched if not self._is_local(each))
                self._has_changes = True
        if not self._has_changes:
            return
        self._has_changes = False
        pairs = sorted(
            own_gid + other_gid for own_gid, matched in self._remote_matches.items() for other_gid in matched
        )
        data = b"".join((self._gid, *pairs[:_MAX_PAIRS]))
        if data != self._published_data:
            self._writer.write(create_sample(self._sample_class, self._types.encode(_TYPE, {"data": data})))
            self._published_data = data

    def _is_local(self, gid: bytes) -> bool:
        return gid[:PREFIX_BYTES] == self._gid[:PREFIX_BYTES]

    def process(self, cdr: bytes) -> None:
        """Store the matches that another program published. Malformed data is ignored."""
        try:
            decoded = self._types.decode(_TYPE, cdr)
        except DecodeError:
            return
        data = decoded["data"] if isinstance(decoded, dict) else b""
        sender, pairs = data[:GID_BYTES], data[GID_BYTES:]
        if len(sender) < GID_BYTES or len(pairs) % (2 * GID_BYTES) or self._is_local(sender):
            return
        gid_pairs = (
            (pairs[offset : offset + GID_BYTES], pairs[offset + GID_BYTES : offset + 2 * GID_BYTES])
            for offset in range(0, len(pairs), 2 * GID_BYTES)
        )
        self._confirmed_pairs.pop(sender, None)
        if len(self._confirmed_pairs) >= _MAX_PARTICIPANTS:
            self._confirmed_pairs.pop(next(iter(self._confirmed_pairs)))
        self._confirmed_pairs[sender] = frozenset(
            pair
            for pair in gid_pairs
            if self._is_local(pair[1]) and pair[0][:PREFIX_BYTES] == sender[:PREFIX_BYTES]
        )

    def is_confirmed(self, own_gid: bytes, other_gid: bytes, participant: bytes) -> bool:
        """Return True if another program has reported a match of its endpoint with one of ours.

        Args:
            own_gid: GUID of our endpoint.
            other_gid: GUID of the other program's endpoint. Endpoints of this program count as confirmed.
            participant: GUID of the other program's participant.
        """
        return self._is_local(other_gid) or (other_gid, own_gid) in self._confirmed_pairs.get(participant, ())

    def unmatched_gids(
        self, entities: Iterable[Any], endpoints: Iterable[tuple[bytes, bytes, bool]]
    ) -> set[bytes]:
        """Return the GUIDs of the known endpoints that aren't matched on both sides.

        Args:
            entities: Writers or readers of this program.
            endpoints: For each endpoint its GUID, the GUID of its participant, and True if its program
                publishes its matches.
        """
        matches = [(each.guid.bytes, matched_gids(each)) for each in entities]
        return {
            gid
            for gid, participant, has_match_reports in endpoints
            if not any(
                gid in matched and (not has_match_reports or self.is_confirmed(own_gid, gid, participant))
                for own_gid, matched in matches
            )
        }
