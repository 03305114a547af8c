"""`nep play`: a recording's messages onto the network again, those that a person names."""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.options import MasterOption
from nep.cli.recording_files import (
    FileArgument,
    FromOption,
    RecordedTopicsArgument,
    ToOption,
    chosen_topics,
    clock_text,
    span_ns,
)
from nep.cli.screen import console, say
from nep.cli.topic_wait import node_for
from nep.errors import NepError
from nep.i18n import _, listed, ngettext, number
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.protocol.wire import check_topic
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from typing_extensions import Self

    from nep.recordings import player, reader
else:  # the other commands need not wait for it, nor have what it needs
    player = lazy_module("nep.recordings.player")
    reader = lazy_module("nep.recordings.reader")

_LOOK_S = 0.2


def play(
    file: FileArgument,
    topics: RecordedTopicsArgument = None,
    publish_all: Annotated[
        bool, typer.Option("--all", help=_("All topics, but those that move robots."))
    ] = False,
    arm: Annotated[
        bool, typer.Option("--arm", help=_("Also send what moves robots, of the topics that are named."))
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

    Nothing is sent that is not named: topics, patterns in quotes, or --all. Commands of robots are sent only
    with --arm, and when they are named.
    """
    with reader.Recording(file) as recording:
        moving = player.moving_topics(recording)
        chosen = _chosen(recording, topics or (), moving, publish_all=publish_all)
        names = _names(chosen, remap or ())
        # A robot's commands move it also under another name, where somebody may hear them.
        sent = (*chosen, *names.values())
        moved = [each for each in sent if each in moving or player.is_command_topic(each)]
        if moved and not arm:
            raise NepError(
                _("'{topic}' moves a robot; add --arm when nobody is in its way").format(topic=moved[0])
            )
        try:
            playback = player.Playback(recording, topics=chosen, remap=names)
            playback.speed = speed
            _set_part(recording, playback, span_ns(recording, from_s, to_s), loop=loop)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
        with node_for("play", master) as node, _Sender(node, recording, chosen, names) as sender:
            _play(recording, playback, sender)
            said = ngettext("published {count} message", "published {count} messages", sender.count)
            say(said.format(count=sender.count))


def _chosen(
    recording: reader.Recording, words: Sequence[str], moving: Collection[str], *, publish_all: bool
) -> list[str]:
    """The topics to publish; of those that move robots only the named ones. Raises `typer.BadParameter`."""
    if not words and not publish_all:
        known = listed([f"'{each}'" for each in list(recording.topics)[:20]], "and")
        raise typer.BadParameter(
            _("name the topics to publish, or --all; the recording has {topics}").format(topics=known)
        )
    named = chosen_topics(recording, words)
    if not publish_all:
        return named
    for name in recording.topics:
        if name in moving and name not in named:
            said = _("'{topic}' moves a robot and is not sent; name it and add --arm to send it")
            say(said.format(topic=name))
    return [name for name in recording.topics if name not in moving or name in named]


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
        self, node: Node, recording: reader.Recording, chosen: Sequence[str], names: dict[str, str]
    ) -> None:
        self._opened = ExitStack()
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
            publisher.publish_bytes(bytes(each.data), dict(each.extension) or None)
            self.count += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._opened.close()


def _play(recording: reader.Recording, playback: player.Playback, sender: _Sender) -> None:
    ended = threading.Event()
    out = console(stderr=True)
    with player.Player(playback, sender.send, on_jump=_nothing, on_end=ended.set) as playing:
        playing.order(lambda each: each.play())
        if out.is_terminal:
            with out.status("") as shown:
                while not ended.wait(_LOOK_S):
                    shown.update(_line(recording, playing.status))
        else:
            while not ended.wait(_LOOK_S):
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
