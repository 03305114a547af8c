"""A topic is subscribed while somebody looks."""

from __future__ import annotations

from app.core.watches import Watches


def test_the_first_watch_begins_and_the_last_ends() -> None:
    calls: list[str] = []
    watches = Watches(lambda topic: calls.append(f"+{topic}"), lambda topic: calls.append(f"-{topic}"))
    first = watches.open(["/a", "/b"])
    with watches.open(["/a"]):
        assert watches.watched("/a")
    first.close()
    first.close()
    assert calls == ["+/a", "+/b", "-/a", "-/b"]
    assert not watches.watched("/a")
