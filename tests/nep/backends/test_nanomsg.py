"""Tests of the nanomsg back end: direct connections, libnanomsg programs, a missing pynng."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator

import pynng
import pytest

import nep
from nep.backends.nanomsg.library import load_pynng
from nep.masters.master import Master
from tests.nep.programs import eventually


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("n", "NN", master="127.0.0.1:1") as made:
        yield made


@pytest.mark.parametrize("mode", ["one2many", "many2one"])
@pytest.mark.parametrize("subscriber_first", [True, False])
def test_one_sided_direct_connection_delivers_in_each_start_order_without_a_master(
    node: nep.Node, port: int, mode: str, subscriber_first: bool
) -> None:
    conf = node.direct("127.0.0.1", port, mode)
    if subscriber_first:
        sub = node.new_sub("t", "json", conf)
        pub = node.new_pub("t", "json", conf)
    else:
        pub = node.new_pub("t", "json", conf)
        sub = node.new_sub("t", "json", conf)
    eventually(lambda: pub.subscribers == 1)
    pub.publish({"n": 1})
    assert sub.listen(timeout_s=30.0) == (True, {"n": 1})
    assert sub.lost is None


@pytest.mark.skipif(shutil.which("nanocat") is None, reason="nanocat is missing (Debian: nanomsg-utils)")
def test_messages_are_exchanged_with_nanocat(node: nep.Node, port: int) -> None:
    pub = node.new_pub("t", "json", node.direct(port=port))
    told = ["nanocat", "--sub", "--connect-local", str(port), "--subscribe", "t ", "--raw"]
    with subprocess.Popen(told, stdout=subprocess.PIPE) as cat:
        eventually(lambda: pub.subscribers == 1)
        pub.publish({"n": 1})
        assert cat.stdout is not None
        assert cat.stdout.read(9) == b't {"n":1}'
        cat.terminate()
    pub.close()
    sub = node.new_sub("u", "json", node.direct(port=port, mode="many2one"))
    said = ["nanocat", "--pub", "--connect-local", str(port), "--data", 'u {"n":2}', "--interval", "0.05"]
    with subprocess.Popen(said) as cat:
        assert sub.listen(timeout_s=30.0) == (True, {"n": 2})
        cat.terminate()


def test_empty_and_foreign_messages_to_a_direct_subscriber_are_rejected(node: nep.Node, port: int) -> None:
    sub = node.new_sub("t", "json", node.direct(port=port, mode="many2one"))
    with pynng.Pub0() as peer:
        peer.dial(f"tcp://127.0.0.1:{port}", block=True)
        for message in (b"", b"\xff", b't {"n":1}'):
            peer.send(message)
        assert sub.listen(timeout_s=30.0) == (True, {"n": 1})


def test_large_message_warning_is_logged_once(
    node: nep.Node, port: int, caplog: pytest.LogCaptureFixture
) -> None:
    conf = node.direct(port=port, mode="many2one")
    sub, pub = node.new_sub("t", "bytes", conf), node.new_pub("t", "bytes", conf)
    eventually(lambda: pub.subscribers == 1)
    for _ in range(2):
        pub.publish(bytes(2**20 + 1))
        assert sub.listen(timeout_s=30.0)[0]
    assert len(re.findall("'t' is 1048577 bytes.*libnanomsg.* 1048576 bytes", caplog.text)) == 1


def test_invalid_direct_connections_are_rejected(node: nep.Node, port: int) -> None:
    with pytest.raises(nep.NepError, match=r"'nanomsg' .*'many2many'.*'one2many'"):
        node.new_pub("t", "json", node.direct(port=port, mode="many2many"))
    with pytest.raises(nep.NepError, match="wire='native'"):
        node.new_sub("t", "json", node.direct(port=port, wire="native"))
    node.new_pub("t", "json", node.direct(port=port))
    with pytest.raises(nep.AddressInUseError):
        node.new_pub("t", "json", node.direct(port=port))


def test_missing_pynng_is_reported_with_the_install_command() -> None:
    def missing(_name: str) -> object:
        raise ImportError

    with pytest.raises(nep.NepError, match="'nanomsg' isn't installed; install it with 'pip install"):
        load_pynng(missing)  # type: ignore[arg-type]


def test_pynng_is_not_imported_unless_requested() -> None:
    code = "import sys, nep; nep.node('a').close(); sys.exit('pynng' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.usefixtures("patient")
def test_nanomsg_and_zeromq_subscribers_ignore_publishers_of_the_other_back_end(
    master: Master, caplog: pytest.LogCaptureFixture
) -> None:
    with nep.node("a", "nanomsg") as ours, nep.node("b", "zeromq") as theirs:
        pubs = ours.new_pub("t"), theirs.new_pub("t")
        subs = ours.new_sub("t"), theirs.new_sub("t")
        for n, pub in enumerate(pubs):
            pub.publish(n)
        for n, sub in enumerate(subs):
            assert sub.listen(timeout_s=30.0) == (True, n)
            assert sub.listen() == (False, {})
    assert "of 'a': the endpoint belongs to 'nanomsg'" in caplog.text
    assert "of 'b': not an endpoint of 'nanomsg'" in caplog.text
