"""`nep play`: publish messages of a recording."""

from __future__ import annotations

import threading
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.network import open_command_node
from nep.cli.options import AllowMovingOption, MasterOption
from nep.cli.recordings.recording_files import (
    FileArgument,
    FromOption,
    RecordedTopicsArgument,
    ToOption,
    clock_text,
    exit_if_damaged,
    parse_span_ns,
    selected_topics,
)
from nep.cli.screen import console, print_status
from nep.errors import NepError
from nep.i18n import _, format_list, ngettext, number
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.programs.robots.guard import MotionGuard, denial_text
from nep.programs.robots.moving import MovingTopics
from nep.protocol.wire import check_topic
from nep.system.lazy_import import lazy_module
from nep.text import quotable

if TYPE_CHECKING:
    from typing_extensions import Self

    from nep.recordings import player, reader
    from nep.recordings.formats import damage
else:  # imported on use: other commands stay fast and need no extra packages
    damage = lazy_module("nep.recordings.formats.damage")
    player = lazy_module("nep.recordings.player")
    reader = lazy_module("nep.recordings.reader")

_STATUS_PERIOD_S = 0.2
_ROBOT_DISCOVERY_S = 1.0
"""Time in seconds to wait for robot descriptions; until then the topics of their programs are blocked."""
_MAX_TOPICS = 1_000
"""Maximum number of topics, because each needs a publisher that is announced to the whole network."""


def play(
    file: FileArgument,
    topics: RecordedTopicsArgument = None,
    publish_all: Annotated[
        bool, typer.Option("--all", help=_("Publish all topics except those that move robots."))
    ] = False,
    allow_moving: AllowMovingOption = None,
    arm: Annotated[
        bool,
        typer.Option("--arm", help=_("Allow the named topics to move any robot.")),
    ] = False,
    speed: Annotated[
        float, typer.Option("--speed", metavar=_("FACTOR"), help=_("Playback speed, 0.1 to 10."))
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help=_("Repeat until Ctrl+C."))] = False,
    from_s: FromOption = None,
    to_s: ToOption = None,
    remap: Annotated[
        list[str] | None,
        typer.Option(
            "--remap", metavar="OLD=NEW", help=_("Publish a topic under another name."), show_default=False
        ),
    ] = None,
    master: MasterOption = None,
) -> None:
    """Publish the messages of a recording with their original timing, until its end or Ctrl+C.

    Specify the topics by names or by patterns in quotes, or use --all. Topics that move a robot, according
    to the recording or to a connected robot, need --allow-moving, or --arm if they are named.
    Robots that connect later are protected, too.
    """
    with reader.Recording(file) as recording:
        named_topics = _named_topics(recording, topics or (), publish_all=publish_all)
        selected = list(recording.topics) if publish_all else named_topics
        if not any(recording.topics[each].message_count for each in selected):
            reason = _("nothing to play: '{file}' has no messages of these topics").format(file=file)
            damage_text = damage.corruption_text(recording.corruption, recording.start_ns)
            raise NepError(f"{reason}; {damage_text}" if damage_text else reason)
        if len(selected) > _MAX_TOPICS:
            template = _("'{file}' has {count} matching topics; choose at most {most}")
            raise NepError(template.format(file=file, count=len(selected), most=_MAX_TOPICS))
        names = _remapped_names(selected, remap or ())
        armed = frozenset(named_topics) if arm else frozenset[str]()
        permissions = _MotionPermissions(recording, names, frozenset(allow_moving or ()), armed)
        selected = permissions.filter_allowed(selected, named_topics)
        try:
            playback = player.Playback(recording, topics=selected, remap=names)
            playback.speed = speed
            _select_part(recording, playback, parse_span_ns(recording, from_s, to_s), loop=loop)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
        with open_command_node("play", master) as node:
            permissions.guard = MotionGuard(node)
            permissions.guard.wait_for_descriptions(_ROBOT_DISCOVERY_S)
            selected = permissions.filter_allowed(selected, named_topics)
            if not selected:
                raise NepError(_("nothing to publish: all chosen topics are blocked"))
            playback.select_topics(selected)
            with _Sender(node, recording, selected, permissions) as sender:
                _play(recording, playback, sender)
                template = ngettext("published {count} message", "published {count} messages", sender.count)
                print_status(template.format(count=sender.count))
        exit_if_damaged(recording)
        if permissions.was_named_topic_blocked:
            raise typer.Exit(1)


def _named_topics(recording: reader.Recording, patterns: Sequence[str], *, publish_all: bool) -> list[str]:
    if not patterns and not publish_all:
        topic_names = format_list([f"'{quotable(each)}'" for each in list(recording.topics)[:20]], "and")
        raise typer.BadParameter(
            _("specify the topics to publish, or use --all; the recording has {topics}").format(
                topics=topic_names
            )
        )
    return selected_topics(recording, patterns)


class _MotionPermissions:
    """Permissions of replayed topics. Topics that would move robots without permission are blocked."""

    def __init__(
        self,
        recording: reader.Recording,
        names: Mapping[str, str],
        allowed: Collection[str],
        armed: Collection[str],
    ) -> None:
        self.names = names
        self.guard: MotionGuard | None = None
        self.was_named_topic_blocked = False
        self._topics = recording.topics
        self._recorded_moving = player.moving_topics(recording)
        self._allowed, self._armed = allowed, armed
        self._named_topics: frozenset[str] = frozenset()
        self._checked_moving: MovingTopics | None = None
        self._block_reasons: dict[str, str] = {}

    def filter_allowed(self, selected: Sequence[str], named_topics: Sequence[str]) -> list[str]:
        # Returns the topics that may be published. Raises `typer.BadParameter` if a named one is blocked.
        self._named_topics = frozenset(named_topics)
        allowed_topics = []
        for topic in selected:
            reason = self._block_reason(topic)
            if not reason:
                allowed_topics.append(topic)
            elif topic in self._named_topics:
                raise typer.BadParameter(reason)
            else:
                print_status(_("not published: {reason}").format(reason=reason))
        return allowed_topics

    def allows(self, topic: str) -> bool:
        # Reports on stderr each topic that becomes blocked, once.
        if self.guard is not None and self.guard.moving_topics is not self._checked_moving:
            self._checked_moving = self.guard.moving_topics
            self._block_reasons = self._find_blocked(self._block_reasons)
        return topic not in self._block_reasons

    def _find_blocked(self, previous_reasons: Mapping[str, str]) -> dict[str, str]:
        block_reasons = {}
        for recorded_topic in self._topics:
            name = self.names.get(recorded_topic, recorded_topic)
            reason = self._block_reason(recorded_topic)
            if reason:
                block_reasons[name] = reason
                if name not in previous_reasons:
                    print_status(_("not published: {reason}").format(reason=reason))
                    self.was_named_topic_blocked |= recorded_topic in self._named_topics
        return block_reasons

    def _block_reason(self, recorded_topic: str) -> str:
        name = self.names.get(recorded_topic, recorded_topic)
        if recorded_topic in self._armed or recorded_topic in self._allowed:
            return ""
        live_robots = () if self.guard is None else self.guard.moving_topics.robots_moved_by(name)
        recorded_robots = self._recorded_moving.robots_moved_by(
            recorded_topic, self._topics[recorded_topic].msg_type
        )
        recorded_robots = recorded_robots or self._recorded_moving.robots_moved_by(name)
        # names of connected robots win, unless the guard only knows the topic
        robots = recorded_robots or live_robots if live_robots in ((), (name,)) else live_robots
        return denial_text(name, robots, self._allowed)


def _remapped_names(selected: Sequence[str], remap: Sequence[str]) -> dict[str, str]:
    # Returns new names by old ones. Raises `typer.BadParameter`, `BadTopicError`.
    names: dict[str, str] = {}
    for remapping in remap:
        old, separator, new = remapping.partition("=")
        if not separator or not new or old not in selected:
            raise typer.BadParameter(
                _("'{word}' isn't a valid remapping; use --remap OLD=NEW with a topic that is played").format(
                    word=remapping
                )
            )
        names[old] = check_topic(new)
    return names


def _select_part(
    recording: reader.Recording,
    playback: player.Playback,
    part: tuple[int | None, int | None],
    *,
    loop: bool,
) -> None:
    # Raises `ValueError` for an empty part.
    start, end = part
    if start is not None or end is not None:
        playback.loop(start or recording.start_ns, recording.end_ns if end is None else end)
        playback.rewind()
    if loop:
        playback.loop(*(playback.status().loop or (None, None)))
    else:
        playback.play_once()


class _Sender:
    """Sender of replayed messages that opens one publisher per topic and type."""

    def __init__(
        self,
        node: Node,
        recording: reader.Recording,
        selected: Sequence[str],
        permissions: _MotionPermissions,
    ) -> None:
        self.permissions, names = permissions, permissions.names
        self._stack = ExitStack()
        self._subscriber_counts: dict[Publisher, int] = {}
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._node = node
        self.count = 0
        latched = player.latched_topics(recording, selected)
        self._latched = {names.get(each, each) for each in latched}
        for topic in selected:  # before the first message, so that subscribers connect in time
            self._open_publisher(names.get(topic, topic), recording.topics[topic].msg_type)

    def _open_publisher(self, topic: str, msg_type: str) -> Publisher:
        key = (topic, msg_type)
        if key not in self._publishers:
            publisher = self._node.new_pub(topic, msg_type, latched=topic in self._latched)
            self._publishers[key] = self._stack.enter_context(publisher)
        return self._publishers[key]

    def send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            publisher = self._open_publisher(message.topic, player.published_type(message))
            subscriber_count = publisher.subscribers
            if subscriber_count != self._subscriber_counts.get(publisher):  # a robot may have connected
                self._subscriber_counts[publisher] = subscriber_count
                self.poll_guard()
            if not self.permissions.allows(message.topic):
                continue
            publisher.publish_bytes(bytes(message.data), dict(message.extension) or None)
            self.count += 1

    def poll_guard(self) -> None:
        if self.permissions.guard is not None:
            self.permissions.guard.poll()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._stack.close()


def _play(recording: reader.Recording, playback: player.Playback, sender: _Sender) -> None:
    ended = threading.Event()
    out = console(stderr=True)
    interrupts.exit_on_termination()

    def wait() -> bool:
        sender.poll_guard()
        return ended.wait(_STATUS_PERIOD_S)

    with player.Player(playback, sender.send, on_jump=_ignore_jump, on_end=ended.set) as running_player:
        running_player.apply(lambda each: each.play())
        if out.is_terminal:
            with out.status("") as status_display:
                while not wait():
                    status_display.update(_status_line(recording, running_player.status))
        else:
            while not wait():
                pass
    if running_player.problem is not None:
        raise running_player.problem


def _ignore_jump(_messages: Sequence[Message]) -> None:
    # Messages before the chosen part are not published.
    ...


def _status_line(recording: reader.Recording, status: player.PlayerStatus) -> str:
    position = clock_text((status.position_ns - recording.start_ns) / 1e9)
    line = _("{time} of {whole}").format(time=position, whole=clock_text(recording.duration_s))
    true_speed = status.measured_speed
    if true_speed is not None and true_speed < 0.9 * status.speed:
        line += "  " + _("{is_now}x instead of {asked}x").format(
            asked=number(status.speed, "g"), is_now=number(true_speed, ".1f")
        )
    return line
