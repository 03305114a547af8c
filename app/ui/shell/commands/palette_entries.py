"""Entries of the command palette: commands, panels, topics, robots, layouts, files and examples."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence

from app.core.networks.networks import topic_label
from app.core.projects.titles import recent_titles
from app.core.session import Session
from app.ui.shell.actions.actions import Actions
from app.ui.shell.actions.shortcuts import Shortcuts
from app.ui.shell.commands.shell import Shell
from app.ui.shell.docking.layouts import layout_named
from app.ui.text.dates import relative_day_text
from app.ui.widgets.lists.fuzzy import Entry
from nep.i18n import _

TOPIC_ICONS = {"json": "braces", "string": "type", "bytes": "binary", "image": "image"}


class PaletteEntries:
    """Factory of the palette entries of a window.

    The entries of topics are cached until the topics change.
    """

    def __init__(
        self,
        shell: Shell,
        session: Session,
        actions: Actions,
        shortcuts: Shortcuts,
    ) -> None:
        self._shell, self._session, self._shortcuts, self._actions = shell, session, shortcuts, actions
        self._cached_topic_entries: list[Entry] = []
        self._topic_revisions = (-1, -1)

    def all(self) -> list[Entry]:
        """Return all entries. Among equally good matches the palette keeps this order."""
        return [
            *self._commands(),
            *self._panels(),
            *self._robots(),
            *self._layouts(),
            *self._files(),
            *self._examples(),
            *self._topic_entries(),
        ]

    def _commands(self) -> list[Entry]:
        entries = []
        self._actions.add_contributions()
        for command in self._actions.commands:
            if not command.in_palette:
                continue
            key, reason = (
                self._shortcuts.first_shortcut(command.id),
                self._actions.disabled_reason(command.id),
            )
            icon = command.icon or "chevrons-right"
            entries.append(Entry(f"command:{command.id}", command.label, icon, _(command.menu), key, reason))
        return entries

    def _panels(self) -> list[Entry]:
        bench = self._shell.bench
        open_keys: Sequence[str] = bench.open_names() if bench is not None else ()
        entries = []
        for panel in sorted(self._shell.panels.values(), key=lambda panel: _(panel.title)):
            position = open_keys.index(panel.name) + 1 if panel.name in open_keys else 0
            key = self._shortcuts.first_shortcut(f"panel.{position}") if 0 < position < 10 else ""
            entries.append(Entry(f"panel:{panel.name}", _(panel.title), panel.icon, "", key))
            if panel.allows_multiple and panel.name in open_keys:
                label = _("Another panel: {panel}").format(panel=_(panel.title))
                entries.append(Entry(f"another:{panel.name}", label, "plus"))
        return entries

    def _robots(self) -> list[Entry]:
        links = self._session.fleet.links
        return [Entry(f"robot:{link.name}", link.name, "bot", link.chip_text) for link in links]

    def _layouts(self) -> list[Entry]:
        custom_layouts = self._shell.saved_layouts.all()
        return [
            Entry(f"layout:{each.name}", each.name, "panel-left", _(layout_named(each.base).title))
            for each in custom_layouts
        ]

    def _files(self) -> list[Entry]:
        now = dt.datetime.now().astimezone()
        entries = []
        for file in recent_titles(self._session.settings.all_recent_files):
            when = relative_day_text(dt.datetime.fromtimestamp(file.opened_s).astimezone(), now)
            reason = ""
            if not file.exists:
                reason = _("No longer in {folder}").format(folder=file.path.parent.name)
            entries.append(Entry(f"file:{file.path}", file.name, "file", when, reason=reason))
        return entries

    def _examples(self) -> list[Entry]:
        examples = self._shell.examples
        return [Entry(f"example:{each.path}", each.name, "blocks", each.text) for each in examples]

    def _topic_entries(self) -> list[Entry]:
        topics, networks = self._session.shown.topics, self._session.shown.networks
        if (topics.revision, networks.revision) != self._topic_revisions:
            self._topic_revisions = topics.revision, networks.revision
            current_topics = [
                *topics.existing_topics(),
                *(topic for topic in networks.topics if topic.gone_since_s is None),
            ]
            self._cached_topic_entries = [
                Entry(
                    f"topic:{topic.key}",
                    topic_label(topic.key),
                    TOPIC_ICONS.get(topic.codec, "list"),
                    topic.msg_type,
                )
                for topic in current_topics
            ]
        return self._cached_topic_entries
