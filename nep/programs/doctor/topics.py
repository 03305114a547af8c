"""Diagnosis of one topic: a pure function from facts to findings, without sockets or clock."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches

from nep.i18n import _, listed, number
from nep.programs.doctor.facts import PublisherFact, TopicFacts
from nep.programs.doctor.finding import Finding, ago
from nep.programs.doctor.network import NOT_SERVED, not_served
from nep.system.addresses import is_loopback

__all__ = ["meant_topic", "topic_findings"]

QUIET_S = 2.0
"""Silence before a publisher that sends rarely counts as silent."""
_MAX_NAMED = 5


def topic_findings(facts: TopicFacts) -> tuple[Finding, ...]:
    """Return the findings about the topic under diagnosis, most likely cause first."""
    if facts.bad_name:
        return (
            Finding(
                "topic:name",
                "error",
                _("“{topic}” is no name of a topic: {reason}.").format(
                    topic=facts.topic, reason=facts.bad_name
                ),
                _("Choose one that is there."),
            ),
        )
    if not facts.publishers:
        return tuple(_unpublished(facts))
    found = [finding for each in facts.publishers for finding in _publisher(facts, each)]
    found += [_from_alert(each.id, each.sentence, each.hint) for each in facts.alerts]
    return (*found, *_arrival(facts, is_explained=any(each.severity == "error" for each in found)))


def meant_topic(topic: str, names: Iterable[str]) -> str | None:
    """Return the published name that `topic` most likely means, or None.

    Tries in this order: the name without slashes and case, a unique name with the same last part, similar
    spelling.
    """
    names = [name for name in names if name != topic]
    wanted = _normalized(topic)
    same = [name for name in names if _normalized(name) == wanted]
    if same:
        return same[0]
    ends = [name for name in names if _normalized(name).rpartition("/")[2] == wanted.rpartition("/")[2]]
    if len(ends) == 1:
        return ends[0]
    by_bare = {_normalized(name): name for name in names}
    return next((by_bare[near] for near in get_close_matches(wanted, list(by_bare), n=1)), None)


def _normalized(topic: str) -> str:
    return topic.strip("/").casefold()


def _unpublished(facts: TopicFacts) -> Iterator[Finding]:
    sentence = _("Nobody publishes {topic}.").format(topic=facts.topic)
    near = meant_topic(facts.topic, facts.others)
    service = facts.topic if facts.topic in facts.services else ""
    if near is not None:
        yield Finding("topic:near", "error", sentence, _near_words(facts, near), instead=near)
    elif service:
        words = _("There is a service of this name: it answers who calls it, and publishes nothing.")
        yield Finding("topic:service", "error", sentence, words, instead=service)
    else:
        words = _("Start the program that does; what is published now: {topics}.")
        known = sorted(name for name in facts.others if not name.startswith("/nep/"))  # hide nep's own topics
        some = known[:_MAX_NAMED]
        if not some:
            words = _("Start the program that does; nothing else is published, either.")
        more = len(known) - len(some)
        names = [*some, _("{count} more").format(count=more)] if more else some
        yield Finding("topic:nobody", "error", sentence, words.format(topics=listed(names) if names else ""))
    if facts.is_shared:
        yield Finding(
            "topic:shared",
            "info",
            _("Other computers may connect to the master at {address}.").format(address=facts.address),
            _(
                "Is the program on another computer? Then it needs the master's address in the network as "
                "its NEP_MASTER, and the master's computer a firewall that lets NEP Studio (Python) through."
            ),
        )
    elif is_loopback(facts.address):
        yield Finding(
            "topic:closed",
            "info",
            _("The master at {address} serves programs of this computer only.").format(address=facts.address),
            _("Is the program on another computer? Then let other computers connect."),
        )


def _near_words(facts: TopicFacts, near: str) -> str:
    rate_hz = facts.others[near]
    if rate_hz is None:
        return _("Did you mean {topic}?").format(topic=near)
    words = _("Did you mean {topic}? Its publishers send {rate} messages a second.")
    return words.format(topic=near, rate=number(rate_hz, ".3g" if rate_hz < 100 else ".0f"))


def _publisher(facts: TopicFacts, each: PublisherFact) -> Iterator[Finding]:
    if each.generation in NOT_SERVED:
        yield not_served(f"topic:version:{each.node}", each.node, each.generation)
    elif each.reach:
        yield _unreached(each)
    elif not facts.received:
        yield from _silence(facts, each)


def _unreached(each: PublisherFact) -> Finding:
    place = each.endpoint.removeprefix("tcp://")
    if each.reach == "elsewhere":
        sentence = _("“{node}” publishes for its own computer, {host}, only.")
        fix = _(
            "It knows its master by an address of that computer alone. Start it with the address in the "
            "network as its NEP_MASTER."
        )
    elif each.reach == "timeout":
        sentence = _("Nothing answers at {place} ({host}), where “{node}” publishes.")
        fix = _(
            "A firewall keeps programs out there, or it is another network. Let Python through the firewall "
            "of {host}."
        )
    elif each.reach == "refused":
        sentence = _("Nobody listens at {place} ({host}) any more, where “{node}” published.")
        fix = _("The program has ended or hangs. Start it again.")
    else:
        sentence = _("There is no way to {place} ({host}), where “{node}” publishes.")
        fix = _("Look whether both computers are in the same network.")
    holes = {"node": each.node, "host": each.host, "place": place}
    return Finding(f"topic:address:{each.node}", "error", sentence.format(**holes), fix.format(**holes))


def _silence(facts: TopicFacts, each: PublisherFact) -> Iterator[Finding]:
    quiet_s = facts.now_s - each.last_s if each.last_s is not None else None
    if quiet_s is not None and quiet_s < max(QUIET_S, facts.listened_s):
        return  # it sends; `_arrival` reports missing messages
    if quiet_s is None and each.sent:
        return
    if quiet_s is None or each.last_s is None:
        sentence = _("“{node}” is there, but has sent nothing on {topic} yet.")
        fix = _("Look at that program: what does it wait for?")
    else:
        sentence = _("“{node}” is there, but has sent nothing on {topic} for {ago}.")
        at = time.strftime("%H:%M:%S", time.localtime(each.last_s))
        words = _("Its last message came at {at}. Look at that program: what does it wait for?")
        if each.sent:
            words = _(
                "Its last message was number {count}, at {at}. Look at that program: what does it wait for?"
            )
        fix = words.format(count=number(each.sent or 0, ".0f"), at=at)
    remedy = next(iter(each.remedies), "")
    if remedy:
        fix += " " + _("It offers the service “{service}”.").format(service=remedy)
    yield Finding(
        f"topic:silent:{each.node}",
        "error",
        sentence.format(node=each.node, topic=facts.topic, ago=ago(quiet_s or 0.0)),
        fix,
        instead=remedy,
    )


def _from_alert(id: str, sentence: str, hint: str) -> Finding:
    return Finding(id, "error", sentence if sentence.endswith(".") else f"{sentence}.", hint)


def _arrival(facts: TopicFacts, *, is_explained: bool) -> Iterator[Finding]:
    if facts.unreadable:
        yield Finding(
            "topic:unreadable",
            "error",
            _("Messages of {topic} come, but can't be read: {reason}.").format(
                topic=facts.topic, reason=facts.unreadable
            ),
            _("Look at their bytes in the Inspector, and at the program that sends them: {nodes}.").format(
                nodes=_publisher_text(facts.publishers)
            ),
        )
    elif facts.received:
        words = _("Messages of {topic} come here, and can be read.")
        yield Finding("topic", "ok", words.format(topic=facts.topic))
    elif facts.refused:
        yield Finding(
            "topic:wire",
            "error",
            _("What comes on {topic} is of a version of NEP that this one does not read.").format(
                topic=facts.topic
            ),
            _("Give all programs the same version: {nodes}.").format(nodes=_publisher_text(facts.publishers)),
        )
    elif not is_explained:
        yield Finding(
            "topic:blocked",
            "error",
            _("{topic} is sent by {nodes}, but nothing came here in {seconds} s.").format(
                topic=facts.topic,
                nodes=_publisher_text(facts.publishers),
                seconds=number(facts.listened_s, ".1f"),
            ),
            _("This computer or its network may be very busy, or a firewall lets nothing through."),
        )


def _publisher_text(publishers: Sequence[PublisherFact]) -> str:
    places = dict.fromkeys(f"{each.node} ({each.host})" for each in publishers)
    return listed(list(places)[:_MAX_NAMED])
