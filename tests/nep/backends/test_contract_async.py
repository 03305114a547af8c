"""Contract tests of back ends: receiving and spinning in an asyncio event loop."""

from __future__ import annotations

import asyncio
import functools
import sys
import threading
from collections.abc import Coroutine
from typing import Any

import pytest

import nep
from nep.masters.master import Master
from nep.nodes.loop_wait import loop_wait, yield_to_loop
from tests.nep.meeting import Make
from tests.nep.programs import eventually, running


@pytest.fixture(autouse=True)
def _as_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Event loop without `add_reader`, as the default loop on Windows."""

    def add_reader(*_args: object) -> None:
        raise NotImplementedError

    monkeypatch.setattr(asyncio.SelectorEventLoop, "add_reader", add_reader)


def run(task: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine in a new event loop; raise an error after 60 s."""

    async def bounded() -> Any:
        return await asyncio.wait_for(task, 60.0)

    return asyncio.run(bounded())


async def armed(sub: nep.Subscriber) -> None:
    """Wait until the event loop's thread waits for this subscriber."""
    while sub._transport not in loop_wait()._shared_wait._armed_callbacks:
        await yield_to_loop()


def waiting_threads() -> int:
    return sum(each.name == "nep-async" for each in threading.enumerate())


def test_messages_arrive_in_order_without_loss(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")

    async def main() -> list[object]:
        got: list[object] = []
        for n in range(1000):
            pub.publish(n)
        async for message in sub:
            got.append(message.payload)
            if len(got) == 1000:
                break
        pub.publish("one")
        message = await sub.receive_async()
        assert message is not None
        pub.publish("two")
        return [*got, message.payload, *await sub.listen_async()]

    assert run(main()) == [*range(1000), "one", True, "two"]
    assert (sub.received, sub.lost) == (1002, 0)
    assert waiting_threads() == 0, "asyncio.run has ended it"


def test_many_subscribers_of_a_loop_share_one_thread(make: Make) -> None:
    nodes = [make(f"n{n}") for n in range(3)]
    subs = [nodes[n % 3].new_sub(f"t{n}") for n in range(30)]
    pubs = [nodes[n % 3].new_pub(f"t{n}") for n in range(30)]
    seen: list[int] = []

    async def read(n: int) -> list[object]:
        got: list[object] = []
        async for message in subs[n]:
            got.append(message.payload)
            seen.append(waiting_threads())
            if len(got) == 10:
                break
        return got

    async def main() -> list[list[object]]:
        tasks = [asyncio.create_task(read(n)) for n in range(30)]
        for number in range(10):
            await yield_to_loop()
            for pub in pubs:
                pub.publish(number)
        return list(await asyncio.gather(*tasks))

    assert run(main()) == [list(range(10))] * 30
    assert max(seen) <= 1


def test_async_receive_ends_at_its_timeout_and_rejects_a_negative_one(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")

    async def main() -> None:
        assert await sub.receive_async(0.0) is None
        assert await sub.receive_async(0.02) is None
        assert await sub.listen_async(0.02) == (False, {})
        with pytest.raises(ValueError, match=r"timeout_s must be .*, not -1"):
            await sub.receive_async(-1)
        pub.publish_bytes(b"{no json")
        pub.publish(1)
        assert await sub.listen_async(30.0) == (True, 1)

    run(main())


def test_cancelled_receive_consumes_no_message(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")

    async def main() -> list[object]:
        for n in range(20):
            task = asyncio.create_task(sub.receive_async())
            for _ in range(n):
                await yield_to_loop()
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
        first = asyncio.create_task(sub.receive_async())
        await armed(sub)
        pub.publish(1)
        # The thread has notified the loop, which hasn't resumed the coroutine yet.
        eventually(lambda: sub._transport not in loop_wait()._shared_wait._armed_callbacks)
        first.cancel()
        with pytest.raises(asyncio.CancelledError):
            await first
        pub.publish(2)
        return [(await sub.listen_async(30.0))[1] for _ in range(2)]

    assert run(main()) == [1, 2]


def test_five_coroutines_share_a_subscriber(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")

    async def main() -> list[object]:
        tasks = [asyncio.create_task(sub.listen_async()) for _ in range(5)]
        await armed(sub)
        for n in range(5):
            pub.publish(n)
        return [payload for _ok, payload in await asyncio.gather(*tasks)]

    assert sorted(run(main())) == list(range(5))


@pytest.mark.parametrize("what", ["subscriber", "node"])
def test_close_wakes_waiting_coroutines(make: Make, what: str) -> None:
    node = make("b")
    sub = node.new_sub("topic")
    closed = sub if what == "subscriber" else node

    async def iterate() -> int:
        return len([each async for each in sub])

    async def main() -> None:
        waiting = asyncio.create_task(sub.receive_async())
        iterating = asyncio.create_task(iterate())
        await armed(sub)
        threading.Thread(target=closed.close).start()
        with pytest.raises(nep.ClosedError, match="subscriber 'topic' is closed"):
            await waiting
        assert await iterating == 0
        with pytest.raises(nep.ClosedError):
            await sub.receive_async(0.0)
        await asyncio.to_thread(closed.close)

    run(main())


def test_close_in_the_loop_wakes_a_waiting_coroutine(make: Make) -> None:
    node = make("b")
    sub = node.new_sub("topic")

    async def main() -> None:
        waiting = asyncio.create_task(sub.receive_async())
        await armed(sub)
        sub.close()
        with pytest.raises(nep.ClosedError):
            await waiting

    run(main())


def test_message_flood_does_not_starve_other_coroutines(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    turns: list[int] = []

    async def other() -> None:
        while True:
            turns.append(len(turns))
            await yield_to_loop()

    async def main() -> None:
        for n in range(2000):
            pub.publish(n)
        task = asyncio.create_task(other())
        async for message in sub:
            if message.payload == 1999:
                break
        task.cancel()

    run(main())
    assert len(turns) >= 10


def test_spin_runs_functions_and_coroutine_functions_one_at_a_time(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")
    events: list[object] = []

    async def slow(payload: object) -> None:
        events.append(("begin", payload))
        for _ in range(100):
            await yield_to_loop()
        events.append(("end", payload))

    def quick(message: nep.Message) -> None:
        events.append(("begin", f"quick {message.payload}"))
        events.append(("end", f"quick {message.payload}"))
        if message.payload == 4:
            node.stop_spin()

    node.new_callback("example", "json", functools.partial(slow))
    node.new_callback("example", "json", quick, with_message=True)
    for n in range(5):
        pub.publish(n)
    run(node.spin_async())
    assert len(events) >= 18
    for begin, end in zip(events[::2], events[1::2], strict=True):
        assert (begin[0], end[0], begin[1]) == ("begin", "end", end[1])  # type: ignore[index]
    assert [each[1] for each in events[::2] if isinstance(each[1], str)] == [f"quick {n}" for n in range(5)]  # type: ignore[index]


def test_timers_and_other_coroutines_run_during_an_async_spin(make: Make) -> None:
    node = make("b")
    sub = make("c").new_sub("tick")
    pub = node.new_pub("tick")
    fired: list[int] = []

    async def tick() -> None:
        await yield_to_loop()
        fired.append(len(fired))
        pub.publish(len(fired))

    async def read() -> None:
        async for message in sub:
            if message.payload == 3:
                node.stop_spin()
                break

    timer = node.new_timer(0.002, tick)

    async def main() -> None:
        await asyncio.gather(node.spin_async(), read())
        timer.cancel()
        await node.spin_async(0.01)

    run(main())
    assert len(fired) >= 3


def test_callbacks_added_and_stop_requested_from_other_threads_wake_an_async_spin(make: Make) -> None:
    node, other = make("b"), make("a")
    got: list[object] = []

    async def main() -> None:
        came = asyncio.Event()

        def callback(payload: object) -> None:
            got.append(payload)
            came.set()

        spin = asyncio.create_task(node.spin_async())
        for _ in range(100):
            await yield_to_loop()
        assert not spin.done()
        await asyncio.to_thread(node.new_callback, "t", "json", callback)
        pub = await asyncio.to_thread(other.new_pub, "t")
        await asyncio.to_thread(pub.publish, 1)
        await came.wait()
        await asyncio.to_thread(node.new_timer, 0.001, node.close)
        await spin

    run(main())
    assert got == [1]


@pytest.mark.parametrize("backend", ["memory", "zeromq"])
def test_async_spin_replies_to_service_calls(master: Master, backend: str) -> None:
    with nep.node("server", backend) as node, nep.node("client", backend) as other:
        client = other.new_client("double", timeout_s=30.0)

        async def main() -> None:
            spin = asyncio.create_task(node.spin_async())
            await yield_to_loop()
            await asyncio.to_thread(node.new_server, "double", lambda n: 2 * n)  # type: ignore[operator]
            for n in range(20):
                assert await client.acall(n) == 2 * n
            node.stop_spin()
            await spin

        run(main())


@pytest.mark.parametrize("is_coroutine", [False, True])
def test_exception_in_a_callback_propagates_from_async_spin(make: Make, is_coroutine: bool) -> None:
    node, pub = make("b"), make("a").new_pub("example")

    def fail(_payload: object) -> None:
        raise ZeroDivisionError

    async def fail_later(_payload: object) -> None:
        await yield_to_loop()
        raise ZeroDivisionError

    node.new_callback("example", "json", fail_later if is_coroutine else fail)
    pub.publish(1)

    async def main() -> None:
        with pytest.raises(ZeroDivisionError):
            await node.spin_async(30.0)
        await node.spin_async(0.01)

    run(main())


def test_cancelled_async_spin_releases_its_watchers_and_loses_no_message(make: Make) -> None:
    node, pub = make("b"), make("a").new_pub("example")

    async def main() -> None:
        came = asyncio.Event()
        sub = node.new_callback("example", "json", lambda _payload: came.set())
        spin = asyncio.create_task(node.spin_async())
        pub.publish(1)
        await came.wait()
        spin.cancel()
        with pytest.raises(asyncio.CancelledError):
            await spin
        pub.publish(2)
        assert await sub.listen_async(30.0) == (True, 2)

    run(main())
    assert node._work._watchers == ()


def test_loop_is_woken_at_most_once_per_two_messages_of_a_burst(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first message of a burst wakes the loop; the others are read without another wake."""
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    rings: list[int] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        real = loop.call_soon_threadsafe

        def counted(*args: Any, **named: Any) -> Any:
            rings.append(1)
            return real(*args, **named)

        monkeypatch.setattr(loop, "call_soon_threadsafe", counted)
        for n in range(20):
            task = asyncio.create_task(sub.listen_async())
            await armed(sub)
            pub.publish(n)
            assert await task == (True, n)
        assert len(rings) <= 60
        rings.clear()
        for n in range(1000):
            pub.publish(n)
        for n in range(1000):
            assert await sub.listen_async() == (True, n)
        assert len(rings) <= 500

    run(main())


def test_closed_event_loop_ends_the_waiting_thread(make: Make) -> None:
    sub = make("b").new_sub("topic")
    loop = asyncio.new_event_loop()
    task = loop.create_task(sub.receive_async(0.01))
    assert loop.run_until_complete(task) is None
    assert waiting_threads() == 1
    loop.close()
    eventually(lambda: waiting_threads() == 0)
    make("a").new_pub("topic").publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)
    assert run(sub.receive_async(0.01)) is None, "and another loop begins anew"


def test_two_loops_in_two_threads_share_a_subscriber(make: Make) -> None:
    sub = make("b").new_sub("topic")
    pub = make("a").new_pub("topic")
    got: list[list[object]] = [[], []]
    last = threading.Event()

    async def read(mine: list[object]) -> None:
        async for message in sub:
            mine.append(message.payload)
            if sum(map(len, got)) >= 200:
                last.set()
        mine.append("closed")

    threads = [threading.Thread(target=lambda n=n: asyncio.run(read(got[n]))) for n in range(2)]  # type: ignore[misc]
    for thread in threads:
        thread.start()
    for n in range(200):
        pub.publish(n)
    assert last.wait(30.0)
    sub.close()
    for thread in threads:
        thread.join(30.0)
    assert [each.pop() for each in got] == ["closed", "closed"]
    assert sorted(got[0] + got[1]) == list(range(200))  # type: ignore[type-var]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_coroutine_can_fork(master: Master) -> None:
    code = """
    import asyncio, os, sys, nep
    node = nep.node("a")
    sub, other, pub = node.new_sub("t"), node.new_sub("u"), node.new_pub("t")
    async def child():
        print(len([each async for each in sub]))
        with nep.node("child") as mine:
            own, heard = mine.new_pub("own"), mine.new_sub("own")
            own.publish(1)
            print(heard.listen(timeout_s=30.0))
    async def main():
        assert await sub.receive_async(0.01) is None
        waiting = asyncio.create_task(sub.receive_async())
        assert await other.receive_async(0.01) is None
        pid = os.fork()
        if not pid:
            await child()
            os._exit(0)
        print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
        pub.publish(7)
        print((await waiting).payload)
    asyncio.run(main())
    """
    with running(code) as program:
        assert [program.line() for _ in range(4)] == ["0", "(True, 1)", "0", "7"]
        assert program.end()[1] == ""


def test_killed_publisher_does_not_disturb_a_waiting_loop(master: Master) -> None:
    with nep.node("b") as node:
        sub = node.new_sub("t")
        code = "import nep\nnep.node('a').new_pub('t').publish(1)\nprint('there')\ninput()"
        with running(code) as program:
            assert program.line() == "there"

            async def main() -> None:
                assert await sub.listen_async(30.0) == (True, 1)
                waiting = asyncio.create_task(sub.listen_async())
                await yield_to_loop()
                program.process.kill()
                await asyncio.to_thread(program.process.wait)
                with nep.node("c") as other:
                    other.new_pub("t").publish(2)
                    assert await waiting == (True, 2)

            run(main())
