"""Tests of the state of an Inspector: message, view and comparison, whatever messages and users do."""

from __future__ import annotations

import json

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from app.core.messages import inspected as inspected_module
from app.core.messages import reader as reader_module
from app.core.messages.inspected import NO_BASE, InspectedMessage, View
from app.core.messages.reader import MessageReader, ReadResult, read
from app.core.network.topics import Topic
from nep.messages.message import Message
from tests.examples import examples

TOPIC = "/a"
LIMIT = 64
"""Size in bytes above which messages are large in these tests."""
PADDING = "x" * LIMIT
VALUE_VIEWS = {View.TREE, View.TABLE}
NO_MESSAGE_VIEWS = {View.EMPTY, View.WAITING, View.UNREADABLE}


class SteppedReader(MessageReader):
    """Reader without a thread: the test decodes the submitted message by `finish`."""

    def __init__(self) -> None:
        super().__init__()
        self.submitted: Message | None = None
        self._decoded: ReadResult | None = None

    @property
    def is_busy(self) -> bool:
        return self.submitted is not None

    def submit(self, job: Message) -> None:
        self.submitted = job

    def finish(self) -> None:
        if self.submitted is not None:
            self._decoded, self.submitted = read(self.submitted), None

    def pop_result(self) -> ReadResult | None:
        decoded, self._decoded = self._decoded, None
        return decoded

    def clear(self) -> None:
        super().clear()
        self.submitted = self._decoded = None


@pytest.fixture(autouse=True)
def low_limit(monkeypatch) -> None:
    for module in (inspected_module, reader_module):
        monkeypatch.setattr(module, "LARGE_BYTES", LIMIT)


def make_message(kind: str, number: int) -> Message:
    """Return a message of a kind; the number makes its value unique."""
    codec = {"text": "string", "large text": "string", "image": "image"}.get(kind, "json")
    data = {
        "json": json.dumps({"n": number}),
        "null": "null",
        "malformed": "{bad",
        "large": json.dumps({"n": number, "padding": PADDING}),
        "large malformed": "[" * (LIMIT + 1),
        "text": str(number),
        "large text": f"{number}{PADDING}",
        "image": f"no pixels {PADDING}",
    }[kind]
    return Message(TOPIC, data.encode(), codec, codec, seq=number, stamp_ns=number)


KINDS = ("json", "null", "malformed", "large", "large malformed", "text", "large text", "image")


class Desk:
    """Inspector with its topic, in a test that makes the time pass."""

    def __init__(self) -> None:
        self.reader = SteppedReader()
        self.inspected = InspectedMessage(lambda message: {"image": message.seq}, self.reader)
        self.topic = Topic(TOPIC, publishers=1)
        self.sent: list[Message] = []
        self.now_s = 100.0
        self.is_paused = self.is_recorded = False
        self.problem = ""

    def open(self) -> Desk:
        self.inspected.open(TOPIC)
        return self

    def send(self, kind: str) -> Message:
        message = make_message(kind, len(self.sent) + 1)
        self.topic.previous, self.topic.newest = self.topic.newest, message
        self.sent.append(message)
        return message

    def update(self, passed_s: float = 1.0) -> bool:
        self.now_s += passed_s
        return self.inspected.update(
            self.topic,
            self.now_s,
            is_paused=self.is_paused,
            is_recorded=self.is_recorded,
            problem=self.problem,
        )

    def show(self, kind: str) -> View:
        """Send a message, wait until it is decoded, and return the view."""
        self.send(kind)
        self.update()
        self.reader.finish()
        self.update()
        return self.inspected.view


@pytest.fixture
def desk() -> Desk:
    return Desk().open()


@pytest.mark.parametrize(
    ("kind", "view"),
    [
        ("json", View.TREE), ("null", View.TREE), ("malformed", View.UNDECODABLE), ("large", View.TREE),
        ("large malformed", View.UNDECODABLE), ("text", View.TREE), ("large text", View.LARGE),
        ("image", View.TREE),
    ],
)  # fmt: skip
def test_view_fits_the_message(desk, kind, view) -> None:
    assert desk.show(kind) is view
    assert desk.inspected.message is desk.sent[-1]
    assert bool(desk.inspected.reason) is (view is View.UNDECODABLE)
    desk.inspected.set_mode("table")
    assert desk.update()  # even if the view stays: the mode must be shown
    assert desk.inspected.view is (View.TABLE if view is View.TREE else view)
    desk.inspected.set_mode("raw")
    desk.update()
    assert (desk.inspected.view, desk.inspected.reason) == (View.RAW, "")


def test_without_a_message_the_view_says_why(desk) -> None:
    assert Desk().inspected.view is View.EMPTY
    assert desk.update()
    assert not desk.update()  # nothing has changed
    assert (desk.inspected.view, desk.inspected.has_publisher) == (View.WAITING, True)
    desk.topic.publishers = 0
    assert desk.update()
    assert (desk.inspected.view, desk.inspected.has_publisher) == (View.WAITING, False)
    desk.problem = "unknown type"
    assert desk.update()
    assert (desk.inspected.view, desk.inspected.reason) == (View.UNREADABLE, "unknown type")
    desk.send("json")
    assert desk.update()
    assert (desk.inspected.view, desk.inspected.reason) == (View.TREE, "")


def test_first_large_message_is_announced_and_later_ones_replace_the_contents_when_decoded(desk) -> None:
    first = desk.send("large")
    desk.update()
    assert (desk.inspected.view, desk.inspected.large_bytes) == (View.READING, first.size_bytes)
    desk.reader.finish()
    desk.update()
    assert desk.inspected.value["n"] == 1
    desk.send("large")
    assert not desk.update(2.0)
    assert desk.inspected.message is first
    desk.reader.finish()
    assert desk.update()
    assert desk.inspected.value["n"] == 2


def test_offered_message_is_decoded_on_request_and_kept_while_paused(desk) -> None:
    offered = desk.send("large text")
    desk.update()
    assert (desk.inspected.view, desk.inspected.large_bytes) == (View.LARGE, offered.size_bytes)
    desk.is_paused = True
    desk.inspected.decode_large()
    assert desk.update()
    assert desk.inspected.view is View.READING
    desk.send("json")
    desk.reader.finish()
    desk.update()
    assert (desk.inspected.view, desk.inspected.value) == (View.TREE, f"1{PADDING}")
    desk.is_paused = False
    desk.update()
    assert desk.inspected.value == {"n": 2}


def test_result_of_a_message_that_was_replaced_meanwhile_is_discarded(desk) -> None:
    desk.send("large")
    desk.update()
    assert desk.reader.submitted is desk.sent[0]
    newest = desk.send("json")
    desk.update()
    desk.reader.finish()
    assert not desk.update()
    assert desk.inspected.message is newest


def test_raw_view_shows_a_message_that_is_still_being_decoded(desk) -> None:
    desk.show("json")
    large = desk.send("large")
    desk.update()
    desk.inspected.set_mode("raw")
    desk.update(0.0)
    assert (desk.inspected.view, desk.inspected.message) == (View.RAW, large)
    desk.reader.finish()
    assert not desk.update(0.0)
    desk.inspected.set_mode("tree")
    desk.update(0.0)
    assert desk.inspected.view is View.READING


def test_slow_decoding_of_a_fast_topic_shows_every_decoded_message(desk) -> None:
    desk.show("large")
    for number in range(2, 5):
        desk.send("large")
        desk.update(2.0)  # starts to decode this message
        desk.send("large")
        desk.reader.finish()
        desk.update(2.0)  # shows it, and starts to decode the next one
        assert desk.inspected.value["n"] == 2 * number - 2
        desk.reader.finish()
        desk.update(0.0)


def test_base_is_the_message_before_on_the_topic_even_if_it_was_not_shown(desk) -> None:
    desk.show("json")
    assert desk.inspected.base is NO_BASE
    desk.send("json")
    desk.send("json")
    desk.update()
    assert (desk.inspected.value, desk.inspected.base) == ({"n": 3}, {"n": 2})
    desk.show("malformed")
    desk.show("json")  # the message before can't be decoded: the last one that was
    assert (desk.inspected.value, desk.inspected.base) == ({"n": 5}, {"n": 3})
    desk.show("large")
    assert desk.inspected.base == {"n": 5}


def test_message_that_arrived_in_the_raw_view_is_compared_with_its_own_previous_message(desk) -> None:
    desk.show("json")
    desk.inspected.set_mode("raw")
    desk.show("json")
    desk.show("json")
    assert desk.inspected.view is View.RAW
    desk.is_paused = True
    desk.show("json")
    desk.inspected.set_mode("tree")
    assert desk.update()
    assert (desk.inspected.value, desk.inspected.base) == ({"n": 3}, {"n": 2})


def test_earlier_message_is_kept_until_the_newest_is_selected(desk) -> None:
    for _ in range(3):
        desk.show("json")
    desk.is_paused = True
    desk.inspected.select(desk.sent[1], desk.sent[0])
    assert desk.update()
    desk.show("json")
    assert (desk.inspected.value, desk.inspected.base) == ({"n": 2}, {"n": 1})
    desk.inspected.pin(is_pinned=True, is_earlier=True)
    assert desk.inspected.pinned_stamp_ns == 2
    desk.is_paused = False
    desk.inspected.select(None, None)
    desk.update()
    assert (desk.inspected.value, desk.inspected.base) == ({"n": 4}, {"n": 2})
    desk.inspected.pin(is_pinned=False)
    assert desk.inspected.base == {"n": 3}


def test_return_to_the_newest_message_decodes_it_if_its_decoding_was_discarded(desk) -> None:
    desk.show("large")
    desk.inspected.set_mode("raw")
    newest = desk.send("large")
    desk.update()
    desk.inspected.set_mode("tree")
    desk.update()
    assert desk.inspected.view is View.READING
    desk.is_paused = True
    desk.inspected.select(make_message("large", 1), None)  # a copy, which is decoded in the background
    desk.update()
    assert desk.inspected.message is newest
    desk.is_paused = False
    desk.inspected.select(None, None)
    desk.update()
    desk.reader.finish()
    desk.update()
    assert desk.inspected.message is newest
    assert desk.inspected.view is View.TREE


def test_message_is_removed_when_the_playhead_moves_before_it(desk) -> None:
    desk.is_recorded = True
    desk.show("json")
    desk.topic.newest = desk.topic.previous = None
    assert desk.update()
    assert (desk.inspected.view, desk.inspected.base) == (View.WAITING, NO_BASE)
    desk.is_recorded = False
    desk.show("json")
    desk.topic.newest = None  # the live topic vanished: its last message stays
    assert not desk.update()
    assert desk.inspected.view is View.TREE


def test_small_messages_are_limited_to_ten_per_second(desk) -> None:
    shown = 0
    for _ in range(60):
        desk.send("json")
        shown += desk.update(1 / 30)
    assert 20 <= shown <= 24
    for let_through in (desk.inspected.allow_update, desk.open):
        desk.send("json")
        desk.update(0.0)
        desk.send("json")
        assert not desk.update(0.0)
        let_through()
        assert desk.update(0.0)
        assert desk.inspected.message is desk.sent[-1]
        for _ in range(2):
            desk.send("json")
            desk.update(0.0)  # uses up the burst


class InspectorModel(RuleBasedStateMachine):
    """Random messages and user actions. The invariants hold after every step."""

    def __init__(self) -> None:
        super().__init__()
        self.desk = Desk()
        self.inspected = self.desk.inspected
        self.pinned: object = None

    @rule(kind=st.sampled_from(KINDS))
    def send(self, kind: str) -> None:
        self.desk.send(kind)

    @rule(passed_s=st.sampled_from([0.0, 0.03, 0.5, 2.0]))
    def update(self, passed_s: float) -> None:
        if self.inspected.key:
            message, has_pending = self.inspected.message, self.inspected.pending is not None
            before = self._shown()
            is_changed = self.desk.update(passed_s)
            assert is_changed or before == self._shown()
            if self.desk.is_paused and not has_pending and message is not None:
                assert self.inspected.message is message

    @rule()
    def finish_reading(self) -> None:
        self.desk.reader.finish()

    @rule(mode=st.sampled_from(["tree", "table", "raw"]))
    def set_mode(self, mode) -> None:
        self.inspected.set_mode(mode)
        if self.inspected.key:
            self.desk.update(0.0)

    @rule(is_paused=st.booleans())
    def pause(self, is_paused: bool) -> None:
        self.desk.is_paused = is_paused

    @precondition(lambda self: self.desk.sent and self.inspected.key)
    @rule(data=st.data())
    def select(self, data) -> None:
        number = data.draw(st.integers(0, len(self.desk.sent) - 1))
        self.desk.is_paused = True
        self.inspected.select(self.desk.sent[number], self.desk.sent[number - 1] if number else None)
        self.desk.update(0.0)

    @rule()
    def follow(self) -> None:
        self.desk.is_paused = False
        self.inspected.select(None, None)
        self.inspected.allow_update()
        if self.inspected.key:
            self.desk.update(0.0)

    @precondition(lambda self: self.inspected.view is View.LARGE)
    @rule()
    def decode_large(self) -> None:
        self.desk.is_paused = True
        self.inspected.decode_large()
        assert self.inspected.view is View.READING

    @rule(is_pinned=st.booleans())
    def pin(self, is_pinned: bool) -> None:
        self.inspected.pin(is_pinned=is_pinned)
        self.pinned = self.inspected.base

    @rule(key=st.sampled_from(["", TOPIC]))
    def open(self, key: str) -> None:
        self.inspected.open(key)
        self.desk.is_paused = False
        assert self.inspected.view is (View.WAITING if key else View.EMPTY)

    @rule(publishers=st.integers(0, 1), problem=st.sampled_from(["", "unknown type"]))
    def change_network(self, publishers: int, problem: str) -> None:
        self.desk.topic.publishers, self.desk.problem = publishers, problem

    @rule(is_recorded=st.booleans())
    def rewind(self, is_recorded: bool) -> None:
        self.desk.is_recorded = is_recorded
        self.desk.topic.newest = self.desk.topic.previous = None

    def _shown(self) -> tuple[object, ...]:
        return self.inspected.view, self.inspected.reason, self.inspected.message, self.inspected.reading

    @invariant()
    def view_fits_message_and_mode(self) -> None:
        inspected, view = self.inspected, self.inspected.view
        assert (view is View.EMPTY) is (not inspected.key)
        assert bool(inspected.reason) is (view in {View.UNREADABLE, View.UNDECODABLE})
        if view in NO_MESSAGE_VIEWS:
            assert inspected.message is None
        elif view is not View.READING:
            assert inspected.message in self.desk.sent
        if view in VALUE_VIEWS:
            assert inspected.mode == view.value
            assert inspected.reading.message is inspected.message
            assert inspected.reading.error is None
        if view is View.RAW:
            assert inspected.mode == "raw"
        if view is View.READING:
            assert inspected.pending is not None
        if view is View.LARGE:
            assert (inspected.message.codec, inspected.pending) == ("string", None)
        if view in {View.LARGE, View.READING}:
            assert inspected.large_bytes > LIMIT

    @invariant()
    def base_is_pinned_or_of_another_message(self) -> None:
        inspected = self.inspected
        if inspected.is_pinned:
            assert inspected.base is self.pinned
        elif inspected.view in VALUE_VIEWS and inspected.base is not NO_BASE and inspected.value is not None:
            assert inspected.base is not inspected.value

    @invariant()
    def pending_message_is_being_decoded(self) -> None:
        if self.inspected.pending is not None:
            submitted, decoded = self.desk.reader.submitted, self.desk.reader._decoded
            assert self.inspected.pending in {submitted, decoded.message if decoded is not None else None}

    def teardown(self) -> None:
        # Without further actions, the newest message is shown in the selected mode.
        inspected, newest = self.inspected, self.desk.topic.newest
        self.desk.is_paused = False
        if inspected.key and newest is not None:
            for _ in range(3):
                self.desk.update(2.0)
                self.desk.reader.finish()
                self.desk.update(0.0)
            assert inspected.message is newest
            assert inspected.view in {View.TREE, View.TABLE, View.RAW, View.UNDECODABLE, View.LARGE}
        inspected.close()


def test_view_is_consistent_after_any_messages_and_user_actions() -> None:
    options = settings(
        max_examples=examples(200), stateful_step_count=30, deadline=None, derandomize=True, database=None
    )
    run_state_machine_as_test(InspectorModel, settings=options)
