"""Tests that a topic is subscribed to while at least one watch on it is active."""

from __future__ import annotations

from app.core.network.watches import Watches


def test_first_watch_subscribes_and_last_close_unsubscribes() -> None:
    calls: list[str] = []
    watches = Watches(lambda topic: calls.append(f"+{topic}"), lambda topic: calls.append(f"-{topic}"))
    first = watches.open(["/a", "/b"])
    with watches.open(["/a"]):
        assert watches.is_watched("/a")
    first.close()
    first.close()
    assert calls == ["+/a", "+/b", "-/a", "-/b"]
    assert not watches.is_watched("/a")


def test_suspended_watch_is_unsubscribed_and_resubscribed_on_resume() -> None:
    calls: list[str] = []
    watches = Watches(*(lambda topic, sign=sign: calls.append(f"{sign}{topic}") for sign in "+-!"))
    first, second = watches.open(["/a"]), watches.open(["/a"])
    first.suspend()
    first.suspend()
    assert (calls, watches.is_watched("/a"), first.is_suspended) == (["+/a"], True, True)
    second.close()
    assert calls == ["+/a", "-/a"], "the other one only rests, and still wants to know"
    first.resume()
    first.resume()
    assert calls == ["+/a", "-/a", "+/a"]
    first.suspend()
    first.close()
    assert calls == ["+/a", "-/a", "+/a", "-/a", "!/a"]
    first.resume()
    first.close()
    assert (calls[-1], len(calls), watches.is_watched("/a")) == ("!/a", 5, False)
