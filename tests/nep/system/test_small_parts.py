"""Tests of small parts: inbox, sources, plug-ins, wakers, the I/O thread, addresses and errors."""

from __future__ import annotations

import contextlib
import errno
import re
import select
import selectors
import socket
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.backends.base import Backend
from nep.backends.bases.loss import MAX_UNLISTED_PUBLISHERS, PublisherTracker
from nep.backends.zeromq.io_thread import IoThread, PollState
from nep.backends.zeromq.subscriptions import MAX_SUBSCRIBERS, Subscriptions
from nep.errors import PluginsMissingError, did_you_mean
from nep.messages.message import Message
from nep.messages.queue import Inbox
from nep.protocol.requests import PublisherRecord, RemotePublisher
from nep.protocol.wire import hello_part
from nep.system import addresses
from nep.system.plugins import discover
from nep.system.wakeup import Waker


def message(n: int, size: int = 1) -> Message:
    return Message("t", bytes(size), "bytes", "bytes", seq=n)


@given(st.lists(st.integers(0, 50), max_size=40), st.integers(1, 10), st.integers(1, 100))
def test_inbox_keeps_the_newest_messages_within_both_limits(
    sizes: list[int], most: int, max_bytes: int
) -> None:
    inbox = Inbox("all", most, max_bytes)
    dropped = sum(inbox.put(message(n, size)) for n, size in enumerate(sizes))
    kept = inbox.pop_all()
    assert len(kept) + dropped == len(sizes)
    assert [each.seq for each in kept] == list(range(dropped, len(sizes)))
    assert len(kept) <= most
    assert sum(each.size_bytes for each in kept) <= max_bytes or len(kept) == 1
    assert inbox.pop() is None


def test_inbox_that_keeps_only_the_latest_message_counts_no_drops() -> None:
    inbox = Inbox("latest")
    assert [inbox.put(message(n)) for n in range(3)] == [0, 0, 0]
    assert [each.seq for each in inbox.pop_all()] == [2]


def remote(id: int, node: str = "n", name: str = "N") -> RemotePublisher:
    return RemotePublisher(PublisherRecord(id, "t", "json", "json", ("tcp://x",)), node, name)


def test_sequence_gaps_since_the_echo_are_counted_as_lost() -> None:
    sources = PublisherTracker()
    sources.advance_to(1, 10)
    for seq in (11, 12, 15):
        assert sources.count_message(1, seq, is_alone=False)
    assert (sources.received, sources.lost) == (3, 2)
    sources.advance_to(1, 17)  # reconnected: two messages were published meanwhile
    assert sources.lost == 4


def test_loss_counting_starts_at_the_first_message_without_an_echo() -> None:
    sources = PublisherTracker()
    assert sources.count_message(1, 100, is_alone=False)
    sources.advance_to(1, 100)
    assert (sources.received, sources.lost) == (1, 0)


def test_repeated_latched_message_is_reported_as_duplicate_and_not_counted() -> None:
    sources = PublisherTracker()
    assert sources.count_message(1, 5, is_alone=True)
    assert not sources.count_message(1, 5, is_alone=True)
    assert (sources.received, sources.lost) == (1, 0)


def test_tail_loss_is_counted_at_the_next_renewal_and_reverted_by_a_late_message() -> None:
    sources = PublisherTracker()
    sources.advance_to(1, 0)
    sources.get(1).has_echoed = True
    sources.count_message(1, 1, is_alone=False)
    sources.expect_up_to(1, 3)
    assert sources.lost == 0  # the messages may be in flight
    sources.expect_up_to(1, 3)
    assert sources.lost == 2
    assert sources.count_message(1, 2, is_alone=False)
    assert (sources.received, sources.lost) == (2, 1)
    sources.expect_up_to(99, 5)  # unknown publisher


def test_restarted_publisher_replaces_its_silent_predecessor() -> None:
    sources = PublisherTracker()
    sources.get(1).remote = remote(1)
    assert sources.replaced_publishers(remote(2)) == []
    sources.get(1).is_silent = True
    assert sources.replaced_publishers(remote(2)) == [1]
    assert sources.replaced_publishers(remote(2, name="other")) == []
    sources.mark_closing(1, 7, now=10.0)
    assert (sources.expired_publishers(12.9), sources.expired_publishers(13.0)) == ([], [1])


def test_back_ends_are_discovered_and_a_similar_name_is_suggested() -> None:
    assert set(discover("nep.backends", "BACKEND", Backend)) >= {"memory", "zeromq"}
    with pytest.raises(nep.UnknownBackendError, match="unknown back end 'zeromk'; did you mean 'zeromq'"):
        nep.node("n", "zeromk")
    with nep.node("n", "ZMQ") as node:
        assert "zeromq" in repr(node)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    home = tmp_path / "plugs_for_test"
    home.mkdir()
    (home / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield home  # type: ignore[misc]
    for name in [name for name in sys.modules if name.startswith("plugs_for_test")]:
        del sys.modules[name]


def test_package_without_plug_ins_raises(package: Path) -> None:
    (package / "base.py").write_text("x = 1\n")
    with pytest.raises(PluginsMissingError, match=r"'plugs_for_test' .*'BACKEND'"):
        discover("plugs_for_test", "BACKEND", Backend)


def test_single_file_is_discovered_as_a_plug_in(package: Path) -> None:
    (package / "mine.py").write_text(
        "from nep.backends.base import Backend\nBACKEND = Backend('mine', lambda node: None)\n"
    )
    assert set(discover("plugs_for_test", "BACKEND", Backend)) == {"mine"}
    (package / "wrong.py").write_text("BACKEND = 5\n")
    with pytest.raises(TypeError, match=r"'plugs_for_test.wrong.BACKEND' is not a 'Backend'"):
        discover("plugs_for_test", "BACKEND", Backend)


def test_waker_whose_constructor_was_interrupted_is_finalized_without_an_error() -> None:
    Waker.__new__(Waker).__del__()


def test_waker_makes_its_descriptor_readable_until_cleared() -> None:
    waker = Waker()
    assert select.select([waker.fd], [], [], 0)[0] == []
    for _ in range(100_000):
        waker.wake()
    assert select.select([waker.fd], [], [], 0)[0] == [waker.fd]
    waker.clear()
    assert select.select([waker.fd], [], [], 0)[0] == []
    waker.close()
    waker.wake()
    waker.clear()


class Bell:
    """I/O handler that counts its calls and returns the given poll states."""

    def __init__(self, rests: list[PollState]) -> None:
        self.waker = Waker()
        self.fd = self.waker.fd
        self.rests = rests
        self.served = threading.Semaphore(0)
        self.times: list[float] = []

    def serve(self, now: float) -> PollState:
        self.waker.clear()
        self.times.append(now)
        self.served.release()
        if not self.rests:
            return PollState()
        rest = self.rests.pop(0)
        if rest.due == -1.0:
            raise ZeroDivisionError
        return PollState(rest.is_reading_paused, None if rest.due is None else now + rest.due)


def test_io_thread_serves_on_wake_requests_and_deadlines() -> None:
    io = IoThread("nep-io-test")
    io.start()
    bell = Bell([PollState(), PollState(is_reading_paused=True, due=0.05), PollState(), PollState()])
    io.add(bell)
    assert bell.served.acquire(timeout=30.0)
    bell.waker.wake()
    assert bell.served.acquire(timeout=30.0)
    bell.waker.wake()  # reading is paused: the descriptor isn't polled
    assert bell.served.acquire(timeout=30.0)
    assert bell.times[2] - bell.times[1] >= 0.05
    io.serve_soon(bell)
    assert bell.served.acquire(timeout=30.0)
    io.remove(bell)
    bell.waker.wake()
    assert not bell.served.acquire(timeout=0.02)
    io.close()
    bell.waker.close()


def test_io_thread_serves_a_sender_as_soon_as_its_socket_is_writable() -> None:
    io = IoThread("nep-io-test")
    io.start()
    ours, theirs = socket.socketpair()

    class Sender:
        """I/O handler that sends until the socket's buffer is full."""

        fd = ours.fileno()
        left = 4_000_000
        sent = threading.Event()

        def serve(self, now: float) -> PollState:
            with contextlib.suppress(BlockingIOError):
                while self.left:
                    self.left -= ours.send(bytes(min(self.left, 65_536)))
            if not self.left:
                self.sent.set()
            return PollState(is_reading_paused=True, wants_write=self.left > 0)

    with ours, theirs:
        ours.setblocking(False)
        theirs.settimeout(30.0)
        sender = Sender()
        io.add(sender)
        taken = 0
        while taken < 4_000_000:
            taken += len(theirs.recv(65_536))
        assert sender.sent.wait(30.0)
        io.remove(sender)
        io.close()


def test_failing_socket_does_not_block_other_sockets(caplog: pytest.LogCaptureFixture) -> None:
    io = IoThread("nep-io-test")
    io.start()
    broken, fine = Bell([PollState(due=-1.0)]), Bell([])
    io.add(broken)
    io.add(fine)
    assert broken.served.acquire(timeout=30.0)
    assert fine.served.acquire(timeout=30.0)
    fine.waker.wake()
    assert fine.served.acquire(timeout=30.0)
    io.close()
    assert "error while serving a socket" in caplog.text
    for each in (broken, fine):
        each.waker.close()


@pytest.mark.parametrize(
    ("given_", "address"),
    [(None, "127.0.0.1:7780"), ("10.0.0.5", "10.0.0.5:7780"), ("tcp://h:1", "h:1"), ("", "127.0.0.1:7780")],
)
def test_master_address_is_normalized_and_read_from_the_environment(
    monkeypatch: pytest.MonkeyPatch, given_: str | None, address: str
) -> None:
    monkeypatch.delenv("NEP_MASTER", raising=False)
    assert addresses.master_address(given_) == address
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:5")
    assert addresses.master_address(None) == "127.0.0.1:5"


@pytest.mark.parametrize(
    "address",
    [
        ":5",
        "host:port",
        "host:99999",
        "no host at all",
        "a b:5",
        "ho/st:5",
        "1.2.3",
        "1.2.3.999:5",
        "http://x:1",
        "http://[x]:1",
    ],
)
def test_invalid_master_address_is_rejected(address: str) -> None:
    with pytest.raises(nep.NepError, match=rf"'{re.escape(address)}.*'127\.0\.0\.1:7780'"):
        addresses.master_address(address)


def test_did_you_mean_suggests_a_similar_name_or_lists_the_known_names() -> None:
    assert did_you_mean("jsn", ["json", "string"]) == "did you mean 'json'?"
    assert did_you_mean("xyz", ["json", "string"]) == "known names: 'json', 'string'"


def test_node_names_outside_1_to_200_bytes_are_rejected() -> None:
    for name in ("", "x" * 201):
        with pytest.raises(nep.BadNameError, match=f"the name is {len(name)} bytes; 1 to 200"):
            nep.node(name)


def test_public_names_exist() -> None:
    assert isinstance(nep, ModuleType)
    for name in nep.__all__:
        assert getattr(nep, name) is not None


def test_implausible_sequence_jump_is_rejected_and_counts_no_loss() -> None:
    sources = PublisherTracker()
    sources.advance_to(1, 0)
    assert sources.count_message(1, 1, is_alone=False)
    with pytest.raises(nep.errors.WireError, match="its sequence number jumps from 1 to 184467440737095516"):
        sources.count_message(1, 2**64 - 1, is_alone=False)
    assert not sources.advance_to(1, 2**64 - 1)
    sources.get(1).has_echoed = True
    for _ in range(3):
        sources.expect_up_to(1, 2**64 - 1)
    assert sources.count_message(1, 3, is_alone=False)
    assert (sources.received, sources.lost, sources.get(1).last) == (2, 1, 3)


def test_publisher_is_received_again_after_an_implausible_sequence_jump() -> None:
    sources = PublisherTracker()
    assert sources.count_message(1, 1, is_alone=False)
    far = 1 + 2**32 + 1
    with pytest.raises(nep.errors.WireError):
        sources.count_message(1, far, is_alone=False)
    assert sources.count_message(1, far + 1, is_alone=False)
    assert sources.count_message(1, far + 3, is_alone=False)
    assert (sources.received, sources.lost) == (3, 1)


def test_largest_possible_gap_is_counted() -> None:
    sources = PublisherTracker()
    assert sources.count_message(1, 1, is_alone=False)
    assert sources.count_message(1, 1 + 2**32, is_alone=False)
    assert sources.lost == 2**32 - 1


class Trap(selectors.DefaultSelector):
    """Selector that, once broken, fails as for a closed file descriptor."""

    def __init__(self) -> None:
        super().__init__()
        self.is_broken = False

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if self.is_broken:
            raise OSError(errno.EBADF, "Bad file descriptor")
        return super().select(timeout)


def test_io_thread_survives_poll_errors(caplog: pytest.LogCaptureFixture) -> None:
    made: list[Trap] = []

    def new_selector() -> Trap:
        if len(made) == 1:
            made.append(Trap())
            raise OSError(errno.EMFILE, "Too many open files")
        made.append(Trap())
        return made[-1]

    io = IoThread("nep-io-test", new_selector)
    io.start()
    bell = Bell([])
    io.add(bell)
    assert bell.served.acquire(timeout=30.0)
    made[0].is_broken = True
    io.serve_soon(bell)
    assert bell.served.acquire(timeout=30.0)
    assert bell.served.acquire(timeout=30.0)  # by the new selector, opened at the second attempt
    bell.waker.wake()
    assert bell.served.acquire(timeout=30.0)
    io.remove(bell)
    io.close()
    bell.waker.close()
    assert "polling failed; rebuilding the poller" in caplog.text
    for each in made:
        each.close()


# Windows has only SelectSelector.
@pytest.mark.parametrize("poller", [selectors.DefaultSelector, selectors.SelectSelector])
def test_socket_that_cannot_be_polled_is_served_each_second(
    caplog: pytest.LogCaptureFixture, poller: type[selectors.BaseSelector]
) -> None:
    io = IoThread("nep-io-test", poller)
    io.start()
    bad, fine = Bell([]), Bell([])
    bad.fd = 1_000_000
    io.add(bad)
    io.add(fine)
    for _ in range(2):
        assert bad.served.acquire(timeout=30.0)
    assert fine.served.acquire(timeout=30.0)
    fine.waker.wake()
    assert fine.served.acquire(timeout=30.0)
    io.close()
    assert "can't poll a socket" in caplog.text
    for each in (bad, fine):
        each.waker.close()


def test_removal_from_a_blocked_io_thread_waits_only_once() -> None:
    io = IoThread("nep-io-test")
    held, let_go = threading.Event(), threading.Event()

    class Slow(Bell):
        def serve(self, now: float) -> PollState:
            held.set()
            let_go.wait(60.0)
            return super().serve(now)

    io.start()
    slow = Slow([])
    io.add(slow)
    assert held.wait(30.0)
    others = [Bell([]) for _ in range(100)]
    io.remove(others[0], 0.05)
    for other in others[1:]:
        io.remove(other, 30.0)  # waits of 30 s would exceed pytest's timeout
    let_go.set()
    io.close()
    for each in (slow, *others):
        each.waker.close()


def test_number_of_unlisted_publishers_is_bounded() -> None:
    sources = PublisherTracker()
    for number in range(1, 11):
        sources.add_listed(remote(number))
    for number in range(100, 5000):
        assert sources.count_message(number, 2**64 - 1, is_alone=False)
    assert len(sources.by_id) == MAX_UNLISTED_PUBLISHERS + 10
    assert all(sources.find(number) is not None for number in (*range(1, 11), 4999))
    assert (sources.received, sources.lost) == (4900, 0)
    sources.add_listed(remote(4999))
    sources.pop(4998)
    for number in range(10_000, 20_000):
        sources.get(number)
    assert len(sources.by_id) == MAX_UNLISTED_PUBLISHERS + 11


def test_number_of_subscribers_that_get_an_echo_is_bounded() -> None:
    subscriptions = Subscriptions("t", 7)
    for number in range(MAX_SUBSCRIBERS + 1000):
        greeted = subscriptions.handle_event(b"\1" + hello_part(number, "t", acknowledges_echoes=True), 0)
        assert (greeted is not None) == (number < MAX_SUBSCRIBERS)
    assert (
        len(subscriptions.counts_at_hello)
        == len(subscriptions.hellos)
        == len(subscriptions.windows)
        == MAX_SUBSCRIBERS
    )
    assert subscriptions.rejections.count == 1000
    assert (
        subscriptions.handle_event(b"\1" + hello_part(5, "t", acknowledges_echoes=True), 0) is not None
    )  # same hello
    assert subscriptions.handle_event(b"\0" + hello_part(5, "t", acknowledges_echoes=True), 0) is None
    assert subscriptions.handle_event(b"\1" + hello_part(77_777, "t"), 0) is not None
    assert not subscriptions.all_acknowledge
    for number in range(50_000):  # other filters don't accumulate either
        subscriptions.handle_event(b"\1t\0" + b"%d" % number, 0)
        subscriptions.handle_event(b"\1t", 0)
    assert len(subscriptions.legacy_filters) == 1


def test_inbox_batch_ends_when_its_size_limit_is_reached() -> None:
    inbox = Inbox("all", max_bytes=1000)
    for number in range(10):
        inbox.put(message(number, 100))
    assert [each.seq for each in inbox.pop_all(250)] == [0, 1, 2]
    assert [each.seq for each in inbox.pop_all(0)] == []
    assert len(inbox.pop_all(10_000)) == 7
    assert inbox.put(message(11, 1000)) == 0


def test_silent_publishers_beyond_a_limit_expire() -> None:
    sources = PublisherTracker()
    for number in range(1, MAX_UNLISTED_PUBLISHERS + 11):
        sources.add_listed(remote(number, name=f"N{number}")).is_silent = number != 5
    assert sources.expired_publishers(0.0) == [1, 2, 3, 4, 6, 7, 8, 9, 10]


def test_lost_message_that_is_received_later_is_counted_once() -> None:
    sources = PublisherTracker()
    for seq in (1, 2, 3):
        assert sources.count_message(1, seq, is_alone=False)
    for _ in range(2):
        sources.expect_up_to(1, 5)
    assert (sources.received, sources.lost) == (3, 2)
    # After a reconnection, the publisher sends its whole history.
    told = [seq for seq in (1, 2, 3, 4, 5) if sources.count_message(1, seq, is_alone=True)]
    assert told == [4, 5]
    assert not sources.count_message(1, 5, is_alone=True), "once"
    assert (sources.received, sources.lost) == (5, 0)


def test_newer_message_confirms_the_loss_of_earlier_messages() -> None:
    sources = PublisherTracker()
    sources.count_message(1, 1, is_alone=False)
    for _ in range(2):
        sources.expect_up_to(1, 4)
    assert sources.count_message(1, 3, is_alone=False)
    assert (sources.received, sources.lost) == (2, 2), "2 was overtaken, 4 may still come"
    assert sources.count_message(1, 6, is_alone=False)
    assert (sources.received, sources.lost) == (3, 3), "4 and 5 were overtaken"
    assert not sources.count_message(1, 4, is_alone=True)
    assert sources.received + sources.lost == 6


def test_removed_publisher_counts_its_announced_messages_as_lost() -> None:
    sources = PublisherTracker()
    sources.count_message(1, 1, is_alone=False)
    sources.mark_silent(1, 3)
    assert sources.lost == 0, "it may only be out of reach"
    sources.count_missing(1)
    assert (sources.received, sources.lost) == (1, 2)
    sources.mark_closing(2, 5, now=0.0)  # unknown publisher
    sources.mark_silent(2, 5)
    sources.count_missing(2)
    assert sources.lost == 2
