"""Tests of servers of several nodes in one spin and in an asyncio event loop."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor

import pytest

import nep
from nep.masters.master import Master
from tests.nep.meeting import place_for

LONG_S = 30.0


@pytest.mark.parametrize(
    "backends",
    [
        ("zeromq", "memory"),
        ("memory", "memory"),
        ("zeromq", "zeromq"),
        ("zenoh", "zeromq"),
        ("zenoh", "zenoh"),
    ],
)
def test_servers_of_several_nodes_reply_in_one_spin(master: Master, backends: tuple[str, str]) -> None:
    own = {each: place_for(each, master.address) for each in backends}
    wheres = [own[each] for each in backends]
    with (
        nep.node("first", backends[0], master=wheres[0]) as first,
        nep.node("second", backends[1], master=wheres[1]) as second,
        nep.node("caller one", backends[0], master=wheres[0]) as one,
        nep.node("caller two", backends[1], master=wheres[1]) as two,
        ThreadPoolExecutor(2) as pool,
    ):
        first.new_server("double", lambda request: request * 2)
        second.new_server("half", lambda request: request / 2)
        doubling, halving = one.new_client("double"), two.new_client("half")

        def ask() -> list[object]:
            try:
                return [
                    (doubling.call(n, timeout_s=LONG_S), halving.call(n, timeout_s=LONG_S)) for n in range(50)
                ]
            finally:
                first.stop_spin()
                second.stop_spin()

        answers = pool.submit(ask)
        nep.spin(first, second, timeout_s=LONG_S)
        assert answers.result(LONG_S) == [(n * 2, n / 2) for n in range(50)]


@pytest.mark.parametrize("backend", ["zeromq", "memory", "zenoh"])
def test_server_replies_in_an_asyncio_event_loop(master: Master, backend: str) -> None:
    where = place_for(backend, master.address)

    async def serve(node: nep.Node, client: nep.Client) -> list[object]:
        spinning = asyncio.create_task(node.spin_async(LONG_S))
        loop = asyncio.get_running_loop()
        try:
            return [await loop.run_in_executor(None, client.call, n) for n in range(50)]
        finally:
            node.stop_spin()
            await spinning

    with (
        nep.node("server", backend, master=where) as node,
        nep.node("client", backend, master=where) as caller,
    ):
        node.new_server("double", lambda request: request * 2)
        client = caller.new_client("double", timeout_s=LONG_S)
        assert asyncio.run(serve(node, client)) == [n * 2 for n in range(50)]
