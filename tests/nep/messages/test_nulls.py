"""Tests of NaN and infinity in JSON: sent as null, counted and logged."""

from __future__ import annotations

import dataclasses
import logging
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.messages.codecs import NAN_WARNING_INTERVAL_S, JsonEncoder, find_nan


@dataclasses.dataclass
class Pose:
    x: float
    note: str = "null"


@pytest.mark.parametrize(
    ("payload", "where"),
    [
        ({"pose": {"x": math.nan}}, "pose.x"),
        ({"joints": [1.0, None, -math.inf]}, "joints[2]"),
        (math.inf, "its only value"),
        ({"a": np.array([[1.0], [np.nan]], np.float32)}, "a[1][0]"),
        ({"a": np.float64("nan")}, "a"),
        ({"a": np.float32("inf")}, "a"),
        ({"p": Pose(math.nan)}, "p.x"),
        ({7: (None, math.nan)}, "7[1]"),
    ],
)
def test_nan_or_infinity_is_logged_with_its_field_path(payload, where, caplog):
    teller = JsonEncoder("/odom")
    assert b"null" in teller.encode(payload).data
    assert teller.count == 1
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert (
        f"'/odom' sends NaN or infinity as null, because JSON has neither: at {where}, "
        in record.getMessage()
    )


@pytest.mark.parametrize(
    "payload", [{"a": None}, {"a": "null"}, {"a": [None, 1.5]}, Pose(1.0), [2**53 + 0.0, 1e308]]
)
def test_none_is_not_reported_as_nan(payload, caplog):
    teller = JsonEncoder("/odom")
    teller.encode(payload)
    assert (teller.count, caplog.records) == (0, [])


def test_every_nan_is_counted_but_logged_at_intervals(caplog):
    now = [0.0]
    teller = JsonEncoder("/odom", lambda: now[0])
    for _ in range(1000):
        teller.encode({"x": math.nan})
    now[0] = NAN_WARNING_INTERVAL_S
    teller.encode({"x": math.nan})
    assert teller.count == 1001
    assert [record.args[2] for record in caplog.records] == [1, 1001]


VALUES = st.recursive(
    st.none() | st.floats() | st.text(max_size=3) | st.integers(-(2**63), 2**64 - 1),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=15,
)


@given(VALUES)
def test_nan_detection_has_no_false_positives_or_negatives(payload):
    teller = JsonEncoder("t")
    teller.encode(payload)
    assert (teller.count == 1) == (find_nan(payload) is not None)


def test_publishing_nan_logs_a_warning(master, patient, caplog):
    with nep.node("robot") as node, node.new_sub("/odom") as sub:
        node.new_pub("/odom").publish({"x": math.nan})
        assert sub.listen(timeout_s=30.0) == (True, {"x": None})
        assert "'/odom' sends NaN or infinity as null" in caplog.text


def test_publisher_counts_nan_and_subscriber_receives_null(master, patient, caplog):
    with nep.node("robot") as node, node.new_sub("/odom") as sub:
        pub = node.new_pub("/odom")
        pub.publish({"x": math.nan, "y": None})
        assert sub.listen(timeout_s=30.0) == (True, {"x": None, "y": None})
        assert pub.nulled == 1
        assert "at x, message 1" in caplog.text
        assert node.new_pub("words", "string").nulled == 0
