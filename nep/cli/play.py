"""`nep play`: a recording's messages onto the network again, those that a person names."""

from __future__ import annotations

import threading
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.network import node_for
from nep.cli.options import AllowMovingOption, MasterOption
from nep.cli.recording_files import (
    FileArgument,
    FromOption,
    RecordedTopicsArgument,
    ToOption,
    chosen_topics,
    clock_text,
    end_with_damage,
    span_ns,
)
from nep.cli.screen import console, say
from nep.errors import NepError
from nep.i18n import _, listed, ngettext, number
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.programs.robots.guard import MotionGuard, refusal_words
from nep.programs.robots.moving import MovingTopics
from nep.protocol.wire import check_topic
from nep.system.lazy_import import lazy_module
from nep.text import quotable

if TYPE_CHECKING:
    from typing_extensions import Self

    from nep.recordings import player, reader
    from nep.recordings.formats import damage
else:  # the other commands need not wait for it, nor have what it needs
    damage = lazy_module("nep.recordings.formats.damage")
    player = lazy_module("nep.recordings.player")
    reader = lazy_module("nep.recordings.reader")

_LOOK_S = 0.2
_SETTLE_S = 1.0
"""How long descriptions of robots may take to arrive; until then their programs' topics are not sent."""
_MAX_TOPICS = 1_000
"""Each has a publisher, of which the whole network is told."""


def play(
    file: FileArgument,
    topics: RecordedTopicsArgument = None,
    publish_all: Annotated[
        bool, typer.Option("--all", help=_("All topics, but those that move robots."))
    ] = False,
    allow_moving: AllowMovingOption = None,
    arm: Annotated[
        bool,
        typer.Option("--arm", help=_("Allow every robot to be moved by the topics that are named.")),
    ] = False,
    speed: Annotated[
        float, typer.Option("--speed", metavar=_("FACTOR"), help=_("0.1 to 10 times as fast."))
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help=_("Again and again, until Ctrl+C."))] = False,
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
    """Publish what was recorded, in the time in which it came. Ctrl+C ends it.

    Nothing is sent that is not named: topics, patterns in quotes, or --all. What moves a robot, by the
    recording or by the robots that are there now, is sent only with --allow-moving, or with --arm when it is
    named. A robot that comes later is not moved either.
    """
    with reader.Recording(file) as recording:
        named = _named(recording, topics or (), publish_all=publish_all)
        chosen = list(recording.topics) if publish_all else named
        if not any(recording.topics[each].message_count for each in chosen):
            said = _("nothing of '{file}' can be played: it has no such messages").format(file=file)
            words = damage.damage_words(recording.damage, recording.start_ns)
            raise NepError(f"{said}; {words}" if words else said)
        if len(chosen) > _MAX_TOPICS:
            said = _("'{file}' has {count} such topics; name {most} of them at most")
            raise NepError(said.format(file=file, count=len(chosen), most=_MAX_TOPICS))
        names = _names(chosen, remap or ())
        armed = frozenset(named) if arm else frozenset[str]()
        limits = _Limits(recording, names, frozenset(allow_moving or ()), armed)
        chosen = limits.checked(chosen, named)
        try:
            playback = player.Playback(recording, topics=chosen, remap=names)
            playback.speed = speed
            _set_part(recording, playback, span_ns(recording, from_s, to_s), loop=loop)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
        with node_for("play", master) as node:
            limits.guard = MotionGuard(node)
            limits.guard.settle(_SETTLE_S)
            chosen = limits.checked(chosen, named)
            if not chosen:
                raise NepError(_("nothing is left to publish"))
            playback.choose(chosen)
            with _Sender(node, recording, chosen, limits) as sender:
                _play(recording, playback, sender)
                said = ngettext("published {count} message", "published {count} messages", sender.count)
                say(said.format(count=sender.count))
        end_with_damage(recording)
        if limits.was_named_refused:
            raise typer.Exit(1)


def _named(recording: reader.Recording, words: Sequence[str], *, publish_all: bool) -> list[str]:
    """The topics that words name. Raises `typer.BadParameter`, also when nothing is to be published."""
    if not words and not publish_all:
        known = listed([f"'{quotable(each)}'" for each in list(recording.topics)[:20]], "and")
        raise typer.BadParameter(
            _("name the topics to publish, or --all; the recording has {topics}").format(topics=known)
        )
    return chosen_topics(recording, words)


class _Limits:
    """Which topics may not be published, because they move robots that nobody has allowed to move."""

    def __init__(
        self,
        recording: reader.Recording,
        names: Mapping[str, str],
        allowed: Collection[str],
        armed: Collection[str],
    ) -> None:
        self.names = names
        self.guard: MotionGuard | None = None
        self.was_named_refused = False
        self._topics = recording.topics
        self._recorded = player.moving_topics(recording)
        self._allowed, self._armed = allowed, armed
        self._named: frozenset[str] = frozenset()
        self._seen: MovingTopics | None = None
        self._refused: dict[str, str] = {}

    def checked(self, chosen: Sequence[str], named: Sequence[str]) -> list[str]:
        """Those that may be published. Raises `typer.BadParameter` for a named one that may not."""
        self._named = frozenset(named)
        kept = []
        for topic in chosen:
            refusal = self._refusal(topic)
            if not refusal:
                kept.append(topic)
            elif topic in self._named:
                raise typer.BadParameter(refusal)
            else:
                say(_("not sent: {reason}").format(reason=refusal))
        return kept

    def allows(self, topic: str) -> bool:
        """Whether a message may go out under this name now; says once why not."""
        if self.guard is not None and self.guard.moving is not self._seen:
            self._seen = self.guard.moving
            self._refused = self._refusals(self._refused)
        return topic not in self._refused

    def _refusals(self, before: Mapping[str, str]) -> dict[str, str]:
        refused = {}
        for recorded in self._topics:
            name = self.names.get(recorded, recorded)
            refusal = self._refusal(recorded)
            if refusal:
                refused[name] = refusal
                if name not in before:
                    say(_("not sent: {reason}").format(reason=refusal))
                    self.was_named_refused |= recorded in self._named
        return refused

    def _refusal(self, recorded: str) -> str:
        name = self.names.get(recorded, recorded)
        if recorded in self._armed or recorded in self._allowed:
            return ""
        live = () if self.guard is None else self.guard.moving.moved_by(name)
        known = self._recorded.moved_by(recorded, self._topics[recorded].msg_type)
        known = known or self._recorded.moved_by(name)
        # live names are what moves now; a topic in their place says less than the recording
        robots = known or live if live in ((), (name,)) else live
        return refusal_words(name, robots, self._allowed)


def _names(chosen: Sequence[str], remap: Sequence[str]) -> dict[str, str]:
    """New names by the old ones. Raises `typer.BadParameter`, `BadTopicError` for what can be no topic."""
    names: dict[str, str] = {}
    for each in remap:
        old, separator, new = each.partition("=")
        if not separator or not new or old not in chosen:
            raise typer.BadParameter(
                _("'{word}' is none; write --remap OLD=NEW of a topic that is played").format(word=each)
            )
        names[old] = check_topic(new)
    return names


def _set_part(
    recording: reader.Recording,
    playback: player.Playback,
    part: tuple[int | None, int | None],
    *,
    loop: bool,
) -> None:
    """Raises `ValueError` for a part without length."""
    start, end = part
    if start is not None or end is not None:
        playback.loop(start or recording.start_ns, recording.end_ns if end is None else end)
        playback.begin()
    if loop:
        playback.loop(*(playback.status().loop or (None, None)))
    else:
        playback.once()


class _Sender:
    """Publishes messages, with a publisher for each topic that has any."""

    def __init__(
        self, node: Node, recording: reader.Recording, chosen: Sequence[str], limits: _Limits
    ) -> None:
        self.limits, names = limits, limits.names
        self._opened = ExitStack()
        self._heard: dict[Publisher, int] = {}
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._node = node
        self.count = 0
        latched = player.latched_topics(recording, chosen)
        self._latched = {names.get(each, each) for each in latched}
        for topic in chosen:  # before the first message, so that who listens hears it
            self._publisher(names.get(topic, topic), recording.topics[topic].msg_type)

    def _publisher(self, topic: str, msg_type: str) -> Publisher:
        key = (topic, msg_type)
        if key not in self._publishers:
            made = self._node.new_pub(topic, msg_type, latched=topic in self._latched)
            self._publishers[key] = self._opened.enter_context(made)
        return self._publishers[key]

    def send(self, messages: Sequence[Message]) -> None:
        """Publish their bytes as they were."""
        for each in messages:
            publisher = self._publisher(each.topic, player.published_type(each))
            heard = publisher.subscribers
            if heard != self._heard.get(publisher):  # a robot may have come
                self._heard[publisher] = heard
                self.look()
            if not self.limits.allows(each.topic):
                continue
            publisher.publish_bytes(bytes(each.data), dict(each.extension) or None)
            self.count += 1

    def look(self) -> None:
        """Find out which robots are there now."""
        if self.limits.guard is not None:
            self.limits.guard.look()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._opened.close()


def _play(recording: reader.Recording, playback: player.Playback, sender: _Sender) -> None:
    ended = threading.Event()
    out = console(stderr=True)
    interrupts.leave_when_told()

    def wait() -> bool:
        sender.look()
        return ended.wait(_LOOK_S)

    with player.Player(playback, sender.send, on_jump=_nothing, on_end=ended.set) as playing:
        playing.order(lambda each: each.play())
        if out.is_terminal:
            with out.status("") as shown:
                while not wait():
                    shown.update(_line(recording, playing.status))
        else:
            while not wait():
                pass
    if playing.problem is not None:
        raise playing.problem


def _nothing(_messages: Sequence[Message]) -> None:
    """What was before the part is not published."""


def _line(recording: reader.Recording, status: player.PlayerStatus) -> str:
    at = clock_text((status.position_ns - recording.start_ns) / 1e9)
    line = _("{time} of {whole}").format(time=at, whole=clock_text(recording.duration_s))
    true_speed = status.true_speed
    if true_speed is not None and true_speed < 0.9 * status.speed:
        line += "  " + _("asked {asked}, is {is_now} x").format(
            asked=number(status.speed, "g"), is_now=number(true_speed, ".1f")
        )
    return line
