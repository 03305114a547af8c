"""Status bar with short texts about the session."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.core.network.remote_access import access_status
from app.core.network.web_texts import host_text, web_status
from app.core.robots.health_facts import has_reported, health_items
from app.core.robots.robot_link import STOPPING
from app.core.run.view import connected_text
from app.core.session import Session
from app.core.timeline.times import clock_text, date_text
from app.ui.text.numbers import age_text, group_digits, length_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Separator, StatusItem, paint
from nep.i18n import _, ngettext

StatusEntry = tuple[str, str, str | None]  # icon, text, status
EMPTY_ENTRY: StatusEntry = ("", "", None)
TICK_MS = 33
FIGURE_SPACE = "\u2007"


def _worst_status(severities: Iterable[str]) -> tuple[str, str]:
    return ("circle-x", "error") if "error" in severities else ("triangle-alert", "warn")


class StatusFormatter:
    """Formatter of the session's state for the status bar.

    Each method returns a `StatusEntry` (icon, text, status), which is empty if there is nothing to
    show; only `replayed_recording` returns several.

    Attributes:
        refresh_ms: Moving average of the duration of a refresh of the window in ms.
    """

    def __init__(self, session: Session, clock: Callable[[float], time.struct_time] = time.localtime) -> None:
        self._session = session
        self._clock = clock
        self.refresh_ms = 0.0
        self._web_host = self._web_network = ""

    def alerts(self, *, for_developers: bool = False) -> StatusEntry:
        """Return the number of alerts.

        Args:
            for_developers: True to count alerts that are meant for developers too.
        """
        alerts = self._session.alerts.errors_and_warnings(for_developers=for_developers)
        if not alerts:
            return EMPTY_ENTRY
        icon, status = _worst_status(alert.severity for alert in alerts)
        text = ngettext("{count} alert", "{count} alerts", len(alerts))
        return icon, text.format(count=len(alerts)), status

    def health(self) -> StatusEntry:
        """Return the number of alerts, or the health of the robots if there are none.

        A robot that hasn't reported its state yet is only described as "connected".
        """
        alerts = self.alerts()
        if alerts != EMPTY_ENTRY:
            return alerts
        all_links = self._session.fleet.links
        links = [
            link for link in all_links if link.state != "away"
        ] or all_links  # Health also shows robots that have left
        if not links:
            starting_robots = self._session.starting_robots
            text = connected_text((), starting_robots) if starting_robots else _("No robot")
            return "circle-dashed", text, "off"
        topics, now = self._session.live.topics, time.monotonic()
        link_items = [(link, health_items(link, topics, now, age_text)) for link in links]
        problem_statuses = [
            item.status for _link, items in link_items for item in items if item.needs_attention
        ]
        if problem_statuses:
            icon, status = _worst_status(problem_statuses)
            text = _("{robot}: needs attention ({count})")
            if len(links) > 1:
                text = ngettext(
                    "{robots} robots: {count} warning",
                    "{robots} robots: {count} warnings",
                    len(problem_statuses),
                )
            return (
                icon,
                text.format(robot=links[0].name, robots=len(links), count=len(problem_statuses)),
                status,
            )
        if any(link.state == STOPPING for link in links):
            return "circle-dashed", _("Waiting for Stop to be confirmed"), "off"
        name, count = links[0].name, len(links)
        if all(has_reported(link, items) for link, items in link_items):
            text = ngettext("{count} robot: no problems", "{count} robots: no problems", count)
            text = text if count > 1 else _("{robot}: no problems")
            return "circle-check", text.format(robot=name, count=count), "ok"
        text = ngettext("{count} robot is connected", "{count} robots are connected", count)
        text = text if count > 1 else _("{robot} is connected")
        return "circle-dashed", text.format(robot=name, count=count), "off"

    def save_status(self) -> StatusEntry:
        """Return the time of the last save or, for unsaved changes, the state of the backup.

        The entry is empty for a behaviour without changes that wasn't saved yet.
        """
        project = self._session.document
        if project.dirty and project.journal_error is not None:
            return "circle-x", _("Not saved · no backup"), "error"
        if project.dirty:
            text = _("Not saved · backed up") if project.path is None else _("Unsaved changes · backed up")
            return "save", text, None
        if project.saved_s is None:
            return EMPTY_ENTRY
        saved_time = self._clock(project.saved_s)
        return "save", _("Saved {clock}").format(clock=f"{saved_time.tm_hour}:{saved_time.tm_min:02d}"), None

    def topics(self) -> StatusEntry:
        """Return the number of active topics."""
        topic_count = sum(1 for topic in self._session.live.topics if topic.gone_s is None)
        text = ngettext("{count} active topic", "{count} active topics", topic_count)
        return "", text.format(count=topic_count), None

    def remote_access(self) -> StatusEntry:
        """Return a `StatusEntry` about the computers that can connect to this master."""
        return access_status(self._session.remote_access)

    def remote_access_plain(self) -> StatusEntry:
        """Return the entry of `remote_access`, but without an icon for the default setting."""
        icon, text, status = self.remote_access()
        return ("" if status is None else icon), text, status

    def web_pages(self) -> StatusEntry:
        """Return the network of the web server and the number of connected pages.

        The entry is empty while the server is off.
        """
        web = self._session.web_pages
        if web.host != self._web_host:  # resolving the computer's addresses is slow
            self._web_host, self._web_network = web.host, host_text(web)
        return web_status(web, self._web_network)

    def master(self) -> StatusEntry:
        """Return the state and the address of the master."""
        master = self._session.live.master
        if master.kind == "connected":
            return "circle-check", _("Master {address}").format(address=master.address), "ok"
        if master.kind == "searching":
            text = _("Searching for the master {address}").format(address=master.address)
            return "circle-dashed", text, "off"
        return "circle-dashed", _("No master"), "off"

    def traffic(self) -> StatusEntry:
        """Return the numbers of nodes and topics, and the message rate."""
        graph = self._session.live.graph
        if graph is None:
            return EMPTY_ENTRY
        topic_count = sum(1 for topic in self._session.live.topics if topic.gone_s is None)
        node_count, messages_per_s = len(graph.nodes), self._session.traffic.messages_per_s
        parts = [
            ngettext("{count} node", "{count} nodes", node_count).format(count=node_count),
            ngettext("{count} topic", "{count} topics", topic_count).format(count=topic_count),
        ]
        if messages_per_s is not None:
            parts.append(_("{count} messages/s").format(count=group_digits(round(messages_per_s))))
        return "", ", ".join(parts), None

    def lost(self) -> StatusEntry:
        """Return the number of messages lost during the last 30 s; empty for 0."""
        lost_count = self._session.traffic.lost_30s
        if not lost_count:
            return EMPTY_ENTRY
        text = ngettext("{count} lost in 30 s", "{count} lost in 30 s", lost_count)
        return "triangle-alert", text.format(count=group_digits(lost_count)), "warn"

    def recording(self) -> StatusEntry:
        """Return duration, size and losses of the current recording; empty if there is none."""
        recordings = self._session.recordings
        state = recordings.client.state
        if not recordings.is_recording:
            return EMPTY_ENTRY
        if state.phase == "starting":
            return "circle-dot", _("Starting to record"), "recording"
        lost_count = state.lost + state.unwritten_count
        losses = ngettext("{count} lost", "{count} lost", lost_count).format(count=group_digits(lost_count))
        text = _("Recording {time}, {size}, {losses}").format(
            time=length_text(recordings.elapsed_s),
            size=size_text(state.size_bytes),
            losses=losses if lost_count else _("none lost"),
        )
        return (
            ("triangle-alert", text, "warn") if state.unwritten_count else ("circle-dot", text, "recording")
        )

    def arming(self) -> StatusEntry:
        """Return the remaining arming time and the topics being sent; empty while disarmed."""
        acting = self._session.acting
        if not acting.arming.is_on:
            return EMPTY_ENTRY
        remaining = length_text(math.ceil(acting.arming.remaining_s))
        repeated = acting.outbox.repeated_messages
        replay = self._session.replay
        played_topics = (
            replay.sending.outbox.active_topics if replay is not None and replay.sending is not None else ()
        )
        if played_topics:
            template = ngettext("Sending {count} topic of the recording, armed {time}",
                                "Sending {count} topics of the recording, armed {time}",
                                len(played_topics))  # fmt: skip
            text = template.format(count=len(played_topics), time=remaining)
        elif len(repeated) == 1:
            text = _("Sending “{name}”, armed {time}").format(name=repeated[0].order.name, time=remaining)
        elif repeated:
            template = ngettext("Sending {count} message, armed {time}",
                                "Sending {count} messages, armed {time}",
                                len(repeated))  # fmt: skip
            text = template.format(count=len(repeated), time=remaining)
        else:
            text = _("Armed {time}").format(time=remaining)
        return "triangle-alert", text, "warn"

    def flight_recorder(self) -> StatusEntry:
        """Return the duration stored in the flight recorder; empty while it is off."""
        seconds = self._session.recordings.client.state.ring_s
        if seconds is None:
            return EMPTY_ENTRY
        return "history", _("last {count} s available").format(count=round(seconds)), None

    def replayed_recording(self) -> tuple[StatusEntry, ...]:
        """Return entries about the opened recording: name, time range, contents and losses."""
        replay = self._session.replay
        if replay is None or replay.opened_recording is None:
            return ()
        recording = replay.opened_recording.recording
        name = _("{name}, {size}").format(name=replay.name, size=size_text(recording.size_bytes))
        begin, end = (clock_text(each, digits=0) for each in (replay.start_ns, replay.end_ns))
        when = _("{date}, {begin} to {end}").format(date=date_text(replay.start_ns), begin=begin, end=end)
        topic_count, message_count = len(recording.topics), recording.message_count
        topics_text = ngettext("{count} topic", "{count} topics", topic_count).format(
            count=group_digits(topic_count)
        )
        messages_text = ngettext("{count} message", "{count} messages", message_count).format(
            count=group_digits(message_count)
        )
        lost: StatusEntry = EMPTY_ENTRY
        if replay.lost:
            text = ngettext("{count} lost while recording", "{count} lost while recording", replay.lost)
            lost = ("triangle-alert", text.format(count=group_digits(replay.lost)), "warn")
        return (
            ("history", name, None),
            ("", when, None),
            ("", _("{topics}, {messages}").format(topics=topics_text, messages=messages_text), None),
            lost,
        )

    def live_network_note(self) -> StatusEntry:
        """Return the note shown during a replay: the live network keeps running."""
        return "radio-tower", _("The live network keeps running"), None

    def displayed_messages(self) -> StatusEntry:
        """Return the number of messages of watched topics that were displayed.

        The entry is empty if all messages were displayed.
        """
        traffic = self._session.traffic
        if traffic.shown_30s >= traffic.sent_30s:
            return EMPTY_ENTRY
        text = _("{shown} of {sent} shown in 30 s")
        return (
            "",
            text.format(shown=group_digits(traffic.shown_30s), sent=group_digits(traffic.sent_30s)),
            None,
        )

    def refresh_duration(self) -> StatusEntry:
        """Return the average duration of a refresh of the window."""
        duration_text = f"{round(self.refresh_ms):>2}".replace(" ", FIGURE_SPACE)  # equal width for 9 and 10
        return "", _("Refresh {spent} ms of {most} ms").format(spent=duration_text, most=TICK_MS), None


class StatusBar(QWidget):
    """Status bar, 26 px high, with entries on the left and right.

    `pressed` is emitted with the command of a clicked entry; only some entries have one.
    """

    pressed = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._theme = theme
        self.setObjectName("statusBar")  # sheets end above the widget with this name
        self.setMinimumHeight(theme.size("statusBar"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(_("Status"))
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(16, 0, 16, 0)
        self._row.setSpacing(0)
        self.commands: Mapping[str, str] = {}
        """Command that is run on a click, by the text of the entry."""
        self._left: list[tuple[StatusItem, Separator]] = []
        self._right: list[tuple[StatusItem, Separator]] = []
        self._row.addStretch(1)

    def _add_items(self, items: list[tuple[StatusItem, Separator]], count: int, *, is_right: bool) -> None:
        while len(items) < count:
            item, line = StatusItem(self._theme), Separator(self._theme, upright=True)
            item.pressed.connect(self.pressed)
            container = QWidget()
            row = QHBoxLayout(container)
            row.setContentsMargins(0, 0, 0, 0)
            row.setSpacing(10)
            for widget in (line, item) if is_right else (item, line):
                row.addWidget(widget)
            index = self._row.count() if is_right else len(items)
            self._row.insertWidget(index, container)
            items.append((item, line))

    def show_entries(self, left: Sequence[StatusEntry], right: Sequence[StatusEntry]) -> None:
        """Show the given entries; empty ones are left out.

        Args:
            left: Entries on the left, from left to right.
            right: Entries on the right, from left to right.
        """
        for entries, items, is_right in ((left, self._left, False), (right, self._right, True)):
            visible_entries = [entry for entry in entries if entry[1]]
            self._add_items(items, len(visible_entries), is_right=is_right)
            for index, (item, line) in enumerate(items):
                entry = visible_entries[index] if index < len(visible_entries) else EMPTY_ENTRY
                item.set(*entry)
                item.set_command(self.commands.get(entry[1], ""))
                container = item.parentWidget()
                if container is not None:
                    container.setVisible(bool(entry[1]))
                    container.setContentsMargins(10 if (is_right or index) else 0, 0, 0, 0)
                paint.show_when(line, bool(entry[1]) and (is_right or index < len(visible_entries) - 1))

    def items(self) -> list[StatusItem]:
        """Return the visible items, from left to right."""
        return [item for item, _line in (*self._left, *self._right) if item.text]

    def texts(self) -> list[str]:
        """Return the texts of the visible items, from left to right."""
        return [item.text for item in self.items()]
