"""Formatting of the table of connected pages."""

from __future__ import annotations

import datetime as dt
from typing import TYPE_CHECKING

from app.core.network.web_page_list import ListedPage, dropped_share
from app.core.network.web_texts import location_text, page_name, share_text
from app.ui.text.dates import clock_text
from app.ui.text.numbers import bandwidth_text, rate_text
from nep.i18n import _, number

if TYPE_CHECKING:
    from nep.programs.web.context import PageTopic


def since_text(listed_page: ListedPage) -> str:
    """Format since when a page is connected or disconnected, such as "since 8:32" or "gone for 4 s"."""
    if listed_page.gone_s is not None:
        return _("gone for {seconds} s").format(seconds=int(listed_page.gone_s))
    connected = dt.datetime.fromtimestamp(listed_page.page.since_s).astimezone()
    return _("since {time}").format(time=clock_text(connected))


def direction_text(topic: PageTopic) -> str:
    """Return the translated verb "publishes" or "reads" for a topic of a page."""
    return _("publishes") if topic.is_published else _("reads")


def limit_text(topic: PageTopic) -> str:
    """Format the rate limit of a topic, such as "at most 15/s"; "" if there is none."""
    limit = topic.max_rate_hz
    return _("at most {rate}/s").format(rate=number(limit, ".3g")) if limit else ""


def dropped_text(topic: PageTopic) -> str:
    """Format the share of dropped messages of a topic, such as "0" or "0.3 %"."""
    if topic.dropped_count <= 0:
        return "0"
    return share_text(dropped_share(topic.sent_count, topic.dropped_count))


def page_description(listed_page: ListedPage) -> str:
    """Return the description of a page for screen readers."""
    return ", ".join((page_name(listed_page.page), location_text(listed_page.page), since_text(listed_page)))


def topic_description(topic: PageTopic) -> str:
    """Return the description of a page's topic for screen readers."""
    rate = rate_text(topic.rate_hz)
    parts = (
        f"{direction_text(topic)} {topic.topic}",
        limit_text(topic),
        f"{rate}/s" if rate else "",
        bandwidth_text(topic.bytes_per_s),
        _("{share} dropped").format(share=dropped_text(topic)) if topic.dropped_count else "",
    )
    return ", ".join(filter(None, parts))
