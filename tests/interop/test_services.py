"""Tests of services with the original NEP's `client` and `server`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import nep
from tests.interop.conftest import LONG_S, Peers, Program
from tests.nep.programs import eventually
from tests.ports import free_port

pytestmark = [pytest.mark.interop]
VERSIONS = ("0.5.3.5", "0.5.4.5", "0.5.4.8")


@pytest.fixture
def originals() -> Iterator[Peers]:
    """Programs of the original NEP that don't use its fixed ports."""
    started = Peers()
    yield started
    started.close()


@pytest.fixture
def port() -> int:
    return free_port()


def has_no_server(client: nep.Client) -> bool:
    """Return whether a call finds no server; the first one may only notice that the server has ended."""
    try:
        client.call({}, timeout_s=0.3)
    except nep.NoServerError:
        return True
    except nep.NepError:
        return False
    raise AssertionError("a server that has ended replied")


@pytest.mark.parametrize("version", VERSIONS)
def test_original_client_receives_replies_and_error_replies(
    originals: Peers, port: int, version: str
) -> None:
    client = originals.start(version, "client_at", str(port)).wait_ready()
    with nep.node("server") as node:

        def answer(request):
            if request == {"fail": True}:
                raise LookupError("no such thing")
            return {"heard": request}

        server = node.new_server("/any", answer, node.direct("127.0.0.1", port), threads=1)
        asked = [
            {"n": 1},
            {"text": "gr\u00fc\u00df \u65e5\u672c"},
            {"list": [1, None, 2.5], "map": {"a": {}}},
        ]
        for number, request in enumerate(asked, 1):
            client.tell(request)
            client.wait(lambda number=number: len(client.got) == number, "an answer", LONG_S)
        assert client.got == [{"heard": each} for each in asked]
        client.tell({"fail": True})  # without an error reply the client would wait forever
        assert client.hears({"nep_error": "LookupError", "reason": "no such thing"})
        client.tell({"n": 2})
        assert client.hears({"heard": {"n": 2}})
        eventually(lambda: (server.calls, server.errors) == (5, 1))


@pytest.mark.parametrize("version", VERSIONS)
def test_two_original_clients_receive_their_own_replies(originals: Peers, port: int, version: str) -> None:
    clients = [originals.start(version, "client_at", str(port)) for _ in range(2)]
    with nep.node("server") as node:
        node.new_server("/any", lambda request: request, node.direct("127.0.0.1", port), threads=2)
        for number, client in enumerate(clients):
            client.wait_ready().tell({"from": number})
        assert clients[0].hears({"from": 0})
        assert clients[1].hears({"from": 1})


@pytest.mark.parametrize("version", VERSIONS)
def test_original_server_replies_to_each_call_also_after_a_restart(
    originals: Peers, port: int, version: str
) -> None:
    with nep.node("client") as node:
        client = node.new_client("/any", node.direct("127.0.0.1", port), timeout_s=LONG_S)
        server = originals.start(version, "server_at", str(port)).wait_ready()
        assert client.call({"text": "gr\u00fc\u00df"}) == {"echo": {"text": "gr\u00fc\u00df"}}
        futures = [client.call_async({"n": n}) for n in range(20)]
        assert [each.result(LONG_S) for each in futures] == [{"echo": {"n": n}} for n in range(20)]
        server.kill()
        eventually(lambda: has_no_server(client))
        originals.start(version, "server_at", str(port)).wait_ready()
        assert client.call({"again": 1}) == {"echo": {"again": 1}}


def test_gateway_finds_services_of_originals_and_raises_an_alert_for_an_original_client(
    peers: Peers, master: Program
) -> None:
    with nep.node("ours") as node:
        client = node.new_client("weather", timeout_s=LONG_S)
        server = peers.start("0.5.3.5", "server", "weather").wait_ready()
        assert client.call({"city": "Turin"}) == {"echo": {"city": "Turin"}}
        server.kill()
        with pytest.raises((nep.NoServerError, nep.ServerGoneError)):
            client.call({}, timeout_s=0.3)
        node.new_server("clock", lambda request: request, threads=1)
        peers.start("0.5.4.5", "client", "clock").wait_ready()
        eventually(lambda: "service:clock:original" in {each.id for each in node.graph().alerts})
