"""Tests of showing and setting the parameters of a node in Studio."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from app.core.network.nodes import NodeEntry
from app.core.networks.parameters import (
    NodeParameters,
    format_value,
    parse_parameters,
    parse_value,
    read_only_reason,
)
from app.core.session import Session
from nep.masters.master import Master
from nep.patterns.parameters.node_parameters import parameters_topic
from tests.core.waiting import tick_until


@pytest.fixture
def robot(master: Master) -> Iterator[nep.Node]:
    with nep.node("robot") as node:
        node.parameters.declare("speed", 0.5, min=0, max=2, description="in m/s")
        node.parameters.declare("gait", "walk", choices=("walk", "run"))
        node.parameters.declare("serial", "7", read_only=True)
        yield node


@pytest.fixture
def shown(session: Session, robot: nep.Node) -> Iterator[NodeParameters]:
    made = NodeParameters(session.live.watch, session.shown.topic, session.parameters)
    tick_until(session, lambda: entry(session, robot) is not None)
    tick_until(session, lambda: entry_of(session, robot).can_set_parameters)
    made.show(entry(session, robot))
    tick_until(session, lambda: _refreshed(made).has_received)
    yield made
    made.close()


def entry(session: Session, node: nep.Node) -> NodeEntry | None:
    return session.live.nodes.get(node.id)


def entry_of(session: Session, node: nep.Node) -> NodeEntry:
    found = entry(session, node)
    assert found is not None
    return found


def _refreshed(shown: NodeParameters, now: float = 0.0) -> NodeParameters:
    shown.refresh(now)
    return shown


def values(shown: NodeParameters) -> dict[str, object]:
    return {each.name: each.value for each in shown.all}


def settled(session: Session, shown: NodeParameters) -> str:
    """Wait until the node has replied, and return its rejection, or ""."""
    tick_until(session, lambda: not _refreshed(shown).pending_name)
    return shown.rejection_reason


def test_parameters_have_limits_and_updates_are_received(
    session: Session, robot: nep.Node, shown: NodeParameters
) -> None:
    speed = shown.find("speed")
    assert speed is not None
    assert (speed.value, speed.kind, speed.minimum, speed.maximum) == (0.5, "float", 0, 2)
    assert (shown.find("gait").choices, shown.find("serial").is_read_only) == (("walk", "run"), True)  # type: ignore[union-attr]
    assert shown.change_times_s == {}, "what it was at first has not changed"
    robot.parameters["speed"] = 1.5
    tick_until(session, lambda: values(_refreshed(shown, 7.0))["speed"] == 1.5)
    assert shown.change_times_s == {"speed": 7.0}
    robot.parameters.declare("later", True)
    tick_until(session, lambda: "later" in values(_refreshed(shown, 8.0)))
    assert shown.change_times_s == {"speed": 7.0, "later": 8.0}


def test_parameter_is_set_or_rejected_with_a_reason(
    session: Session, robot: nep.Node, shown: NodeParameters
) -> None:
    robot.parameters.on_change(lambda new: "1.3 shakes the head" if new.get("speed") == 1.3 else None)
    shown.set("speed", "1")
    assert shown.pending_name == "speed"
    assert settled(session, shown) == ""
    assert (robot.parameters["speed"], type(robot.parameters["speed"])) == (1.0, float), (
        "the type must be kept"
    )
    tick_until(session, lambda: values(_refreshed(shown))["speed"] == 1.0)
    for text, said in (
        ("9", "the maximum is 2"),
        ("1,3", "1.3 shakes the head"),
        ("-1e9", "the minimum is 0"),
    ):
        shown.set("speed", text)
        assert said in settled(session, shown)
    for text in ("", "fast", "nan", "inf", "1e999", "true", "[1]"):
        shown.set("speed", text)
        assert (shown.rejection_reason, shown.pending_name) == ("enter a number", "")
    shown.set("gait", "fly")
    assert "use 'walk' or 'run'" in settled(session, shown)
    shown.set("serial", "8")
    assert (shown.rejection_reason, shown.pending_name) == (
        "only the node itself can change this parameter",
        "",
    )
    shown.set("no such", "8")
    assert (robot.parameters["speed"], robot.parameters["gait"], robot.parameters["serial"]) == (
        1.0,
        "walk",
        "7",
    )


def test_number_out_of_wire_range_is_rejected(
    session: Session, robot: nep.Node, shown: NodeParameters
) -> None:
    robot.parameters.declare("count", 1)
    tick_until(session, lambda: "count" in values(_refreshed(shown)))
    for text in (str(2**63), str(2**64), str(-(2**70))):
        shown.set("count", text)
        assert settled(session, shown)
    shown.set("count", str(2**62))
    assert settled(session, shown) == ""
    assert robot.parameters["count"] == 2**62


def test_setting_a_parameter_of_an_unresponsive_or_disappeared_node_is_reported(
    session: Session, robot: nep.Node, shown: NodeParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.core.networks.parameters.REPLY_TIMEOUT_S", 0.3)
    halted = threading.Event()
    robot.parameters.on_change(lambda _new: halted.wait(20.0) and None)
    shown.set("speed", "1")
    try:
        assert f"/nep/parameters/{robot.id}" in settled(session, shown)
    finally:
        halted.set()
    robot.close()
    tick_until(session, lambda: entry_of(session, robot).gone_s is not None)
    shown.set("speed", "1")
    assert (shown.rejection_reason, shown.pending_name) == ("the node has left", "")
    assert values(shown)["serial"] == "7", "what was known stays to be read"


def test_parameter_change_without_master_is_rejected_not_queued(
    session: Session, shown: NodeParameters
) -> None:
    shown._has_master = lambda: False
    shown.set("speed", "1")
    assert shown.pending_name == ""
    assert "no master responds" in shown.rejection_reason


def test_showing_another_node_or_none_clears_parameters(session: Session, shown: NodeParameters) -> None:
    watching, revision = shown.watch_handle, shown.revision
    shown.show(NodeEntry("x", "without"))
    assert (shown.node, shown.all, shown.watch_handle, shown.has_received) == (None, (), None, False)
    assert shown.revision > revision
    assert watching is not None
    assert not session.live.watches.is_watched(watching.topics[0])  # type: ignore[attr-defined]
    shown.show(None)
    shown.refresh(0.0)
    shown.set("speed", "1")
    assert shown.rejection_reason == ""


def test_foreign_messages_on_parameter_topic_are_decoded_or_reported(
    session: Session, robot: nep.Node, shown: NodeParameters
) -> None:
    with nep.node("stranger") as stranger, stranger.new_pub(parameters_topic(robot.id)) as loud:
        tick_until(session, lambda: loud.subscribers)
        for payload in ("words", 7, {"parameters": None}, {}):
            loud.publish(payload)
        tick_until(session, lambda: _refreshed(shown).problem)
        assert shown.problem == "the message contains no list of parameters"
        assert "speed" in values(shown), "what the node told stays"
        loud.publish({"parameters": [1, {"name": ["x"], "type": 5, "min": "a", "choices": 3, "value": None}]})
        tick_until(session, lambda: not _refreshed(shown).problem)
        (strange,) = shown.all
        loud.publish({"parameters": [{"name": "a", "value": 1}, {"name": "a", "value": 2}]})
        tick_until(session, lambda: values(_refreshed(shown)) == {"a": 2})
        loud.publish({"parameters": [{"name": "a", "value": "x" * (5 * 2**20)}]})
        tick_until(session, lambda: "too large" in _refreshed(shown).problem)
        loud.publish({"parameters": [{"name": "a", "value": "x" * 30_000, "type": "str"}]})
        tick_until(session, lambda: not _refreshed(shown).problem)
        shown.set("a", "y")
        assert "too long" in shown.rejection_reason
        assert (strange.name, strange.kind, strange.minimum, strange.choices) == ("['x']", "5", None, ())
        loud.publish_bytes(b"{no json")
        tick_until(session, lambda: _refreshed(shown).problem)


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.floats(allow_nan=False)
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)


@given(state=JSON)
def test_any_parameter_payload_is_decoded_or_rejected(state: object) -> None:
    try:
        found = parse_parameters({"parameters": state} if isinstance(state, list) else state)
    except nep.NepError:
        assert not isinstance(state, list)
    else:
        assert all(isinstance(format_value(each.value), str) for each in found)


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (True, "bool"), (7, "int"), (-0.5, "float"), ("a, b", "str"), ("", "str"), ([1, "x"], "list"),
        ({"x": [1]}, "dict"),
    ],
)  # fmt: skip
def test_parameter_text_round_trips_to_same_value(value: object, kind: str) -> None:
    assert parse_value(format_value(value), kind) == value
    assert type(parse_value(format_value(value), kind)) is type(value)


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("1", "bool", "true or false"), ("yes", "bool", "true or false"), ("1.5", "int", "a whole number"),
        ("9" * 5000, "int", "a whole number"), ("{}", "list", "a list as JSON"),
        ("[", "list", "a list as JSON"),
        ("[1]", "dict", "an object as JSON"), ("", "dict", "an object as JSON"),
        ("[", "other", "a value as JSON"),
    ],
)  # fmt: skip
def test_value_of_wrong_type_is_rejected_with_advice(text: str, kind: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse_value(text, kind)


def test_read_only_parameters_are_explained() -> None:
    (parameter,) = parse_parameters({"parameters": [{"name": "gain", "value": 1, "type": "int"}]})
    node = NodeEntry("a", "arm", network="zenoh", has_parameters=True)
    assert read_only_reason(node, parameter) == "parameters on this network are read-only"
    node.can_set_parameters = True
    assert read_only_reason(node, parameter) == ""
