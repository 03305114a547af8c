"""Fake web server without sockets, and pages for it; replaces `nep.programs.web.WebServer` in Studio."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from nep.programs.web.access import Access
from nep.programs.web.context import ConnectedPage, PageTopic, Rejection
from nep.programs.web.server import WebSettings


def page(
    page_id: int, *topics: PageTopic, title: str = "", origin: str = "http://lab.example"
) -> ConnectedPage:
    """Return a page connected from Chrome at 192.168.1.30."""
    return ConnectedPage(
        page_id,
        f"web_lab.example_{page_id}",
        "192.168.1.30",
        origin,
        1_700_000_000.0,
        "Chrome",
        title=title or f"page{page_id}.html",
        topics=topics,
    )


class FakeWebServer:
    """Fake web server that records its settings; tests set `pages` and `rejections`."""

    def __init__(self, settings: WebSettings | None = None) -> None:
        self.settings = settings if settings is not None else WebSettings()
        self.port = self.settings.port or 9090
        self.access: Access = self.settings.access
        self.allow_moving: Collection[str] = self.settings.allow_moving
        self.foxglove = self.settings.foxglove
        self.pages: tuple[ConnectedPage, ...] = ()
        self.rejections: tuple[Rejection, ...] = ()
        self.rosbridge = self.settings.is_rosbridge_enabled
        self.kept_out: set[int] = set()
        self.has_ended = False

    def set_access(self, access: Access) -> int:
        is_new, self.access = access.token != self.access.token, access
        gone = len(self.pages) if is_new else 0
        if is_new:
            self.pages = ()
        return gone

    def set_allow_moving(self, names: Collection[str]) -> None:
        self.allow_moving = frozenset(names)

    def set_foxglove(self, channels: object) -> int:
        self.foxglove = channels  # type: ignore[assignment]
        return 0

    def set_rosbridge(self, is_enabled: bool) -> int:
        self.rosbridge = is_enabled
        return 0

    def unblock_page(self, page_id: int) -> None:
        self.kept_out.discard(page_id)

    def block_page(self, page_id: int) -> None:
        self.kept_out.add(page_id)
        self.leave(page_id)

    def leave(self, page_id: int) -> None:
        """Simulate that a page closes its connection."""
        self.pages = tuple(each for each in self.pages if each.id != page_id)

    def wait(self, _timeout_s: float) -> bool:
        return self.has_ended

    def close(self) -> None:
        self.has_ended = True

    def change_topic(self, page_id: int, **figures: float) -> None:
        """Change the statistics of a page's first topic."""
        self.pages = tuple(
            replace(each, topics=(replace(each.topics[0], **figures), *each.topics[1:]))  # type: ignore[arg-type]
            if each.id == page_id
            else each
            for each in self.pages
        )
