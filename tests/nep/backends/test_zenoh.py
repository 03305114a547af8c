"""Tests of the zenoh back end: discovery without a master, a router, configuration files and forks."""

from __future__ import annotations

import itertools
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import nep
from nep.backends.zenoh import keys
from nep.backends.zenoh.addresses import CONFIG_VARIABLE, validate_address
from nep.backends.zenoh.library import create_handler, load_zenoh
from nep.backends.zenoh.rendezvous import Rendezvous, SessionEntry
from nep.protocol.requests import NodeRecord, PublisherRecord, SubscriberRecord
from tests.nep.programs import Program, eventually, running

pytestmark = pytest.mark.usefixtures("patient")
_names = itertools.count()
PEER = """
import sys, nep
node = nep.node("peer", "zenoh", master=sys.argv[1])
sub = node.new_sub("to/peer")
pub = node.new_pub("from/peer", latched=True)
print(node.id)
for line in sys.stdin:
    said = line.split()
    if said[0] == "read":
        print(sub.listen(timeout_s=30.0)[1])
    elif said[0] == "publish":
        pub.publish(said[1])
        print(pub.count)
    elif said[0] == "lost":
        print(sub.lost)
"""
ROUTER = """
import sys, zenoh
config = zenoh.Config.from_json5(sys.argv[1])
with zenoh.open(config):
    print("routes")
    sys.stdin.read()
"""


@pytest.fixture
def place() -> str:
    return f"local/test-{os.getpid()}-{next(_names)}"


@pytest.fixture
def make(place: str) -> Iterator[Callable[..., nep.Node]]:
    made: list[nep.Node] = []

    def new(name: str, where: str = place) -> nep.Node:
        made.append(nep.node(name, "Zenoh", master=where))
        return made[-1]

    yield new
    for node in made:
        node.close()


Make = Callable[..., nep.Node]


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def trouble(node: nep.Node) -> str:
    """Return the error of a request for the graph, or "" when it succeeds."""
    try:
        node.graph()
    except nep.NepError as error:
        return str(error)
    return ""


def names(node: nep.Node) -> set[str]:
    return {each.name for each in node.graph().nodes.values()}


def ask(peer: Program, text: str) -> str:
    peer.say(text)
    return peer.line()


# ---- connections between programs


def test_two_programs_connect_without_a_master(make: Make, place: str) -> None:
    with running(PEER, place) as peer:
        peer_id = peer.line()
        node = make("here")
        pub = node.new_pub("to/peer")
        assert (pub.subscribers, pub.missing) == (1, ())
        pub.publish("first")
        assert ask(peer, "read") == "first"
        assert ask(peer, "publish latched") == "1"
        sub = node.new_sub("from/peer")
        message = sub.receive(30.0)
        assert message is not None
        assert (message.payload, message.seq, message.is_latched) == ("latched", 1, True)
        assert ask(peer, "publish next") == "2"
        assert sub.listen(timeout_s=30.0) == (True, "next")
        view = node.graph()
        assert {each.name: each.id for each in view.nodes.values()} == {"here": node.id, "peer": peer_id}
        (publisher,) = view.topics["from/peer"].publishers
        assert (publisher.node_id, publisher.latched, publisher.count) == (peer_id, True, 2)
        assert publisher.rate_hz is None, "nobody looked twice"
        (subscriber,) = view.topics["to/peer"].subscribers
        assert (subscriber.node_id, subscriber.received, subscriber.lost) == (peer_id, 1, 0)
        assert sub.lost == 0


def test_rate_is_known_after_two_polls(make: Make) -> None:
    node = make("a")
    pub = node.new_pub("t")
    assert node.graph().topics["t"].rate_hz is None

    def is_known() -> bool:
        pub.publish(1)
        rate = node.graph().topics["t"].rate_hz
        return rate is not None and rate > 0.0

    eventually(is_known)


@pytest.mark.skipif(sys.platform == "win32", reason="nobody is killed so there")
def test_killed_program_is_removed_and_its_successor_connects_to_the_other_programs(
    make: Make, place: str
) -> None:
    here = make("here")
    pub = here.new_pub("to/peer")
    with running(PEER, place) as peer:
        peer.line()
        assert pub.subscribers == 1
        peer.kill()
        eventually(lambda: pub.subscribers == 0)
        eventually(lambda: names(here) == {"here"})
    with running(PEER, place) as again:
        again.line()
        assert pub.subscribers == 1
        pub.publish(1)
        assert ask(again, "read") == "1"


@pytest.mark.skipif(sys.platform == "win32", reason="nobody is halted so there")
def test_hung_subscriber_is_named_and_does_not_block_publishing(
    make: Make, place: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nep.backends.zenoh.transport.HANDSHAKE_TIMEOUT_S", 0.5)
    here, other = make("here"), make("other")
    here.new_sub("t"), other.new_sub("t")
    with running(PEER, place) as peer:
        peer.line()
        peer.stop()
        pub = here.new_pub("to/peer")
        assert pub.missing == ("peer",)
        view = here.graph()
        assert {each.name for each in view.nodes.values()} == {"here", "other", "peer"}
        (subscriber,) = view.topics["to/peer"].subscribers
        assert view.topics["from/peer"].rate_hz is None
        assert subscriber.received in {0, None}
        for n in range(1000):
            pub.publish(n)  # must not wait for the stopped peer
        pub.close(timeout_s=0.2)
        assert "'to/peer' was closed before 1 subscriber(s) received everything: up to 1000" in caplog.text
        late = make("late")
        late.new_sub("t")
        assert "which is suspended" in caplog.text
        peer.signal(signal.SIGCONT)


def test_messages_published_before_exit_arrive(place: str, make: Make) -> None:
    sub = make("here").new_sub("t", "bytes")
    code = f"""
    import nep
    pub = nep.node("gone", "zenoh", master={place!r}).new_pub("t", "bytes")
    for _ in range(20):
        pub.publish(bytes(1_000_000))
    """
    with running(code) as program:
        got = [sub.receive(30.0) for _ in range(20)]
        assert [each is not None and each.size_bytes for each in got] == [1_000_000] * 20
        assert program.end()[1] == ""
    assert sub.lost == 0


def test_large_and_empty_payloads_arrive(make: Make) -> None:
    sub, pub = make("b").new_sub("t", "bytes"), make("a").new_pub("t", "bytes", latched=True)
    for payload in (b"", bytes(8 * 2**20), b"\0"):
        pub.publish(payload)
        assert sub.listen(timeout_s=30.0) == (True, payload)
    pub.publish(b"")
    assert make("late").new_sub("t", "bytes").listen(timeout_s=30.0) == (True, b"")


@pytest.mark.parametrize("topic", ["*", "**", "a/**/b", "$*", "a//b", "/", "@a", "#?%", "x" * 200, "ü" * 100])
def test_every_topic_maps_to_a_unique_key(make: Make, topic: str) -> None:
    node, other = make("a"), make("b")
    sub, stranger = node.new_sub(topic), node.new_sub("a")
    pub = other.new_pub(topic)
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)
    assert stranger.listen() == (False, {})
    assert set(node.graph().topics) == {topic, "a"}


# ---- keys


@pytest.mark.parametrize("word", ["", "%", "a/b", "*", "é 漢", "x" * 1000])
def test_liveliness_tokens_round_trip(word: str) -> None:
    node = NodeRecord("0123456789abcdef", word, word, 4711, word, word, since_ns=5)
    pub = PublisherRecord(2**64 - 1, word, word, word, (keys.data_key(word),), latched=True)
    sub = SubscriberRecord(1, word, word)
    assert keys.parse_token(keys.node_key(node)) == (node.id, node)
    assert keys.parse_token(keys.publisher_key("n", pub)) == ("n", pub)
    assert keys.parse_token(keys.subscriber_key("n", sub)) == ("n", sub)


@pytest.mark.parametrize(
    "key",
    [
        "",
        "nep/v1/live/",
        "nep/v1/live/n",
        "nep/v1/live/n/node/a/b/c/d/e/f",
        "nep/v1/live/n/node/a/b/-1/d/e/5",
        f"nep/v1/live/n/node/a/b/1/d/e/{2**64}",
        "nep/v1/live/n/pub/xyz/t/json/json/plain",
        "nep/v1/live/n/pub/0/t/json/json/plain",
        f"nep/v1/live/n/sub/{2**64:x}/t/json",
        "nep/v1/live/n/sub/1/t/json/more",
        "other/v1/live/n/sub/1/t/json",
    ],
)
def test_invalid_liveliness_tokens_are_ignored(key: str) -> None:
    assert keys.parse_token(key) is None


def test_invalid_puts_are_rejected_and_counted_and_invalid_replies_ignored(
    make: Make, port: int, caplog: pytest.LogCaptureFixture, place: str
) -> None:
    node = make("a")
    sub = node.new_sub("t")
    with Rendezvous(place.removeprefix("local/")).exclusive():
        others = [each.port for each in Rendezvous(place.removeprefix("local/")).entries()]
    zenoh = load_zenoh()
    config = zenoh.Config.from_json5(
        f'{{mode: "peer", listen: {{endpoints: []}}, scouting: {{multicast: {{enabled: false}}}}, '
        f'connect: {{endpoints: ["tcp/127.0.0.1:{others[0]}"]}}}}'
    )
    with zenoh.open(config) as stranger:
        calls = stranger.declare_queryable(
            "nep/v1/call/evil", create_handler(lambda query: query.reply("nep/v1/call/evil", b"\xc1nonsense"))
        )
        token = stranger.liveliness().declare_token("nep/v1/live/evil/nonsense")
        stranger.put("nep/v1/data/t", b"plain")
        stranger.put("nep/v1/data/t", b"plain", attachment=b"short")
        stranger.put("nep/v1/data/t", b"plain", attachment=bytes(32))
        eventually(lambda: sub.refused == 3)
        assert names(node) == {"a"}
        assert [each.id for each in node.graph().alerts] == ["message:t"]
        for _ in stranger.get("nep/v1/call/*", payload=b"\xff" * 1000):
            pass
        token.undeclare()
        calls.undeclare()
    assert sub.received == 0
    assert "the message has no header; its publisher isn't a nep program" in caplog.text
    pub = node.new_pub("t")
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)


# ---- addresses


def test_zenoh_address_is_taken_from_argument_or_variable_and_validated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(CONFIG_VARIABLE, raising=False)
    assert validate_address() == validate_address("") == "local"
    for given in ("local/lab", "tcp/192.0.2.1:7447", "tls/a.b:1,tcp/c:2", "/etc/zenoh.json5"):
        assert validate_address(given) == given
    monkeypatch.setenv(CONFIG_VARIABLE, "tcp/192.0.2.1:7447")
    assert validate_address() == "tcp/192.0.2.1:7447"
    for wrong in (
        "127.0.0.1:7780",
        "192.0.2.1",
        "tcp://a:1",
        "local/",
        "local/a/b",
        "local/../x y",
        "tcp/a, b",
    ):
        with pytest.raises(nep.NepError, match=f"'{re.escape(wrong)}' .*zenoh.*'local'"):
            nep.node("a", "zenoh", master=wrong)
    with pytest.raises(TypeError, match="'str', not a 'int'"):
        nep.node("a", "zenoh", master=5)  # type: ignore[arg-type]


def test_direct_connections_are_rejected(make: Make) -> None:
    node = make("a")
    with pytest.raises(nep.NepError, match=r"'zenoh' .*direct connections.*omit the configuration"):
        node.new_pub("t", "json", node.direct(port=7000))
    with pytest.raises(nep.NepError, match=r"'zenoh' .*direct connections"):
        node.new_sub("t", "json", node.direct(port=7000))


def test_missing_router_and_invalid_configuration_file_are_reported(port: int, tmp_path: Path) -> None:
    with nep.node("a", "zenoh", master=f"tcp/127.0.0.1:{port}", wait_s=0.2) as node:
        with pytest.raises(nep.NepError, match=f"'tcp/127.0.0.1:{port}': .*router"):
            node.new_pub("t")
        with pytest.raises(nep.NepError, match=f"'tcp/127.0.0.1:{port}': .*router"):
            node.graph(0.1)
    bad = tmp_path / "bad.json5"
    bad.write_text("{mode: 'nonsense'}")
    for path in (bad, tmp_path / "missing.json5"):
        with (
            nep.node("a", "zenoh", master=str(path)) as node,
            pytest.raises(nep.NepError, match=re.escape(f"'{path}'")),
        ):
            node.new_sub("t")


def test_only_loopback_sockets_are_opened(place: str) -> None:
    import psutil

    before = set(psutil.Process().net_connections())
    with nep.node("a", "zenoh", master=place) as node:
        node.new_pub("t")
        opened = [each for each in psutil.Process().net_connections() if each not in before]
        assert opened
        assert {each.laddr.ip for each in opened if each.laddr} == {"127.0.0.1"}
        assert not [each for each in opened if each.type == socket.SOCK_DGRAM]


def test_rendezvous_files_of_ended_programs_are_deleted(place: str, tmp_path: Path) -> None:
    meeting = Rendezvous(place.removeprefix("local/"))
    own = meeting.add(1234)
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        pass
    for name in (
        f"5-{ended.pid}-0",
        f"7-{own.pid}-{own.start_time + 100}",
        "nonsense",
        "1-2",
        f"{2**70}-1-1",
    ):
        (meeting._folder / name).touch()
    assert meeting.entries() == [SessionEntry(1234, os.getpid(), own.start_time)]
    left = {path.name for path in meeting._folder.iterdir()}
    assert {"nonsense", own.name} <= left
    assert not {f"5-{ended.pid}-0", f"7-{own.pid}-{own.start_time + 100}"} & left
    meeting.remove(own)
    assert meeting.entries() == []


def test_file_in_place_of_the_rendezvous_folder_is_reported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "nep-zenoh").touch()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with (
        nep.node("a", "zenoh", master="local") as node,
        pytest.raises(nep.NepError, match=r"nep-zenoh' .*XDG_RUNTIME_DIR"),
    ):
        node.new_pub("t")


# ---- routers


def router(port: int, more: str = "", protocol: str = "tcp") -> str:
    return (
        f'{{mode: "router", listen: {{endpoints: ["{protocol}/127.0.0.1:{port}"]}}, '
        f"scouting: {{multicast: {{enabled: false}}}}{more}}}"
    )


def test_router_connects_programs_and_can_be_restarted(make: Make, port: int) -> None:
    where = f"tcp/127.0.0.1:{port}"
    with running(ROUTER, router(port)) as first:
        first.line()
        with running(PEER, where) as peer:
            peer.line()
            node = make("here", where)
            pub, sub = node.new_pub("to/peer"), node.new_sub("from/peer")
            assert pub.subscribers == 1
            pub.publish(1)
            assert ask(peer, "read") == "1"
            ask(peer, "publish a")
            assert sub.listen(timeout_s=30.0) == (True, "a")
            assert names(node) == {"here", "peer"}
            first.kill()
            eventually(lambda: pub.subscribers == 0)
            eventually(lambda: f"no zenoh router replied at '{where}'" in trouble(node))
            ask(peer, "publish missed")
            with running(ROUTER, router(port)) as second:
                second.line()
                eventually(lambda: pub.subscribers == 1)
                assert sub.listen(timeout_s=30.0) == (True, "missed"), "it is latched"
                assert sub.lost == 0
                assert names(node) == {"here", "peer"}
                peer.kill()
                eventually(lambda: pub.subscribers == 0)


def test_user_configuration_file_is_used(
    make: Make, port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{mode: "peer", connect: {{endpoints: ["tcp/127.0.0.1:{port}"]}}}}')
    monkeypatch.setenv(CONFIG_VARIABLE, str(file))
    with running(ROUTER, router(port)) as between:
        between.line()
        sub = make("b", "").new_sub("t")
        pub = make("a", "").new_pub("t")
        for number in range(1, 61):  # zenoh's router may drop messages while the two connect directly
            pub.publish(number)
            came, first = sub.listen(timeout_s=0.5)
            if came:
                break
        assert came
        assert sub.lost < first  # messages from before the handshake don't count as lost
        import psutil

        listening = [
            each.laddr.ip for each in psutil.Process().net_connections() if each.status == psutil.CONN_LISTEN
        ]
        assert set(listening) <= {"127.0.0.1"}


# ---- missing library and forks


def test_missing_zenoh_is_reported_with_the_install_command() -> None:
    def missing(_name: str) -> object:
        raise ImportError

    with pytest.raises(nep.NepError, match="'zenoh' isn't installed; install it with 'pip install"):
        load_zenoh(missing)  # type: ignore[arg-type]


def test_zenoh_is_not_imported_unless_requested() -> None:
    code = "import sys, nep; nep.node('a').close(); sys.exit('zenoh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_forked_child_raises_an_error_exits_and_holds_no_resources(place: str, make: Make) -> None:
    code = f"""
    import os, sys, nep
    def say(it):  # whole lines at once: parent and child have one output
        os.write(1, (str(it) + "\\n").encode())
    node = nep.node("parent", "zenoh", master={place!r})
    sub, pub = node.new_sub("t"), node.new_pub("t")
    child = os.fork()
    if child == 0:
        for bad in (lambda: pub.publish(1), lambda: sub.listen(), lambda: nep.node("c", "zenoh")):
            try:
                bad()
            except nep.NepError as error:
                say(error)
        sys.stdin.readline()
        sys.exit(7)
    pub.publish("fine")
    say(sub.listen(timeout_s=30.0)[1])
    sys.stdin.readline()
    os.kill(os.getpid(), 9)
    """
    here = make("here")
    here.new_sub("x")
    with running(code) as parent:
        said = {parent.line() for _ in range(4)}
        assert "fine" in said
        assert sum("belongs to the parent process" in each for each in said) == 2
        assert sum("doesn't work in a process forked" in each for each in said) == 1
        assert names(here) == {"here", "parent"}
        import psutil

        (child,) = psutil.Process(parent.process.pid).children()
        parent.process.kill()
        eventually(lambda: names(here) == {"here"})
        assert child.is_running()
        child.kill()


def test_sessions_opened_simultaneously_all_connect(make: Make) -> None:
    import threading

    nodes = [make(f"n{n}") for n in range(6)]
    begin = threading.Barrier(len(nodes))

    def join(node: nep.Node) -> None:
        begin.wait(30.0)
        node.new_sub("t")

    threads = [threading.Thread(target=join, args=(each,)) for each in nodes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for node in nodes:
        assert names(node) == {f"n{n}" for n in range(6)}
    assert nodes[0].new_pub("t").subscribers == 6


def test_node_close_during_subscribing_raises_closed_error(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nep.backends.zenoh.transport.HANDSHAKE_TIMEOUT_S", 0.5)
    import threading

    node = make("a")
    ended = threading.Event()

    def come_and_go() -> None:
        for n in itertools.count():
            node.new_sub(f"t{n % 7}").close()

    def work() -> None:
        with pytest.raises(nep.ClosedError):
            come_and_go()
        ended.set()

    thread = threading.Thread(target=work)
    thread.start()
    eventually(lambda: "a" in names(make("b")))
    node.close()
    thread.join(30.0)
    assert ended.is_set()
