"""Tests of decoding values from maps: the fast path gives the same results as the slow path."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.errors import WireError
from nep.protocol import encoding
from nep.protocol.graph_view import NodeInfo, PublisherInfo, TopicInfo
from nep.protocol.requests import PublisherCount, QueryGraph, Renew, SubscriberCount

PUBLISHER: dict[str, object] = {
    "id": 5,
    "node_id": "n",
    "endpoints": ["tcp://x:1"],
    "latched": False,
    "count": 1,
    "bytes": 2,
    "last_seq": 3,
    "last_stamp_ns": None,
    "rate_hz": 1.5,
    "bandwidth_Bps": None,
}
TOPIC: dict[str, object] = {
    "name": "t",
    "msg_type": "json",
    "codec": "json",
    "publishers": [PUBLISHER],
    "subscribers": [],
    "rate_hz": 1.5,
    "bandwidth_Bps": 2.5,
    "last_stamp_ns": 4,
    "lost": 0,
    "loss_ratio": 0.0,
}
KINDS = (TopicInfo, PublisherInfo, NodeInfo, Renew, PublisherCount, SubscriberCount, QueryGraph)
ITEMS = (
    st.none()
    | st.booleans()
    | st.integers(0, 3)
    | st.floats(0, 3)
    | st.sampled_from(["", "n", [PUBLISHER], [], [1], {}, {"id": 5}, PUBLISHER, b""])
)


def read_slowly(kind: type, value: object) -> object:
    """Decode with maps of a class that the fast path does not handle."""

    class Slow(dict[object, object]):
        pass

    def slow(item: object) -> object:
        if isinstance(item, dict):
            return Slow({key: slow(inner) for key, inner in item.items()})
        return [slow(each) for each in item] if isinstance(item, list) else item

    return said(kind, slow(value)).replace("'Slow'", "'dict'")


def said(kind: type, value: object) -> str:
    try:
        return repr(encoding.from_plain(kind, value))
    except WireError as error:
        return error.reason


@settings(deadline=None, max_examples=300)
@given(
    st.sampled_from([(TopicInfo, TOPIC), (PublisherInfo, PUBLISHER)]),
    st.dictionaries(st.sampled_from([*TOPIC, *PUBLISHER, "mood"]), ITEMS, max_size=3),
    st.sets(st.sampled_from([*TOPIC, *PUBLISHER]), max_size=1),
)
def test_fast_decoding_matches_slow_decoding(
    usual: tuple[type, dict[str, object]], changes: dict[str, object], left_out: set[str]
) -> None:
    kind, whole = usual
    value = {name: item for name, item in (whole | changes).items() if name not in left_out}
    assert said(kind, value) == read_slowly(kind, value)


@given(st.sampled_from(KINDS), st.dictionaries(st.sampled_from([*TOPIC, *PUBLISHER]), ITEMS))
def test_fast_decoding_matches_slow_decoding_of_any_map(kind: type, value: dict[str, object]) -> None:
    assert said(kind, value) == read_slowly(kind, value)


def test_decoded_value_is_independent_of_its_source_map() -> None:
    value = dict(TOPIC)
    read = encoding.from_plain(TopicInfo, value)
    value["name"] = "other"
    assert (read.name, value["publishers"]) == ("t", [PUBLISHER])
    assert read.publishers == (encoding.from_plain(PublisherInfo, PUBLISHER),)


@pytest.mark.parametrize(("item", "kept"), [(2, 2.0), (2.5, 2.5), (None, None)])
def test_int_is_converted_in_float_fields(item: object, kept: object) -> None:
    encoding.from_plain(TopicInfo, TOPIC)
    read = encoding.from_plain(TopicInfo, TOPIC | {"rate_hz": item})
    assert read.rate_hz == kept
    assert type(read.rate_hz) is type(kept)
