"""Derivation of the findings about one topic. Performs no I/O and reads no clock."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches

from nep.i18n import _, format_list, number
from nep.programs.doctor.facts import PublisherFact, TopicFacts
from nep.programs.doctor.finding import Finding, duration_text
from nep.programs.doctor.network import UNSUPPORTED_VERSIONS, unsupported_finding
from nep.system.addresses import is_loopback

MIN_SILENCE_S = 2.0
"""Time in seconds without messages after which a publisher counts as silent."""
_MAX_NAMES = 5


def topic_findings(facts: TopicFacts) -> tuple[Finding, ...]:
    """Return the findings about the topic under diagnosis, most likely cause first."""
    if facts.name_problem:
        return (
            Finding(
                "topic:name",
                "error",
                _("“{topic}” isn't a valid topic name: {reason}.").format(
                    topic=facts.topic, reason=facts.name_problem
                ),
                _("Choose an existing topic."),
            ),
        )
    if not facts.publishers:
        return tuple(_unpublished_findings(facts))
    findings = [finding for each in facts.publishers for finding in _publisher_findings(facts, each)]
    findings += [_alert_finding(each.id, each.sentence, each.hint) for each in facts.alerts]
    return (
        *findings,
        *_arrival_findings(facts, is_explained=any(each.severity == "error" for each in findings)),
    )


def closest_topic(topic: str, names: Iterable[str]) -> str | None:
    """Return the published topic that is most similar to `topic`, or None if none is similar.

    The criteria are, in this order: the same name apart from outer slashes and case, a unique name with
    the same last level, similar spelling.

    Args:
        topic: Name to look for.
        names: Names of the published topics.
    """
    names = [name for name in names if name != topic]
    normalized_topic = _normalized(topic)
    equal_names = [name for name in names if _normalized(name) == normalized_topic]
    if equal_names:
        return equal_names[0]
    names_with_same_suffix = [
        name for name in names if _normalized(name).rpartition("/")[2] == normalized_topic.rpartition("/")[2]
    ]
    if len(names_with_same_suffix) == 1:
        return names_with_same_suffix[0]
    originals = {_normalized(name): name for name in names}
    return next(
        (originals[match] for match in get_close_matches(normalized_topic, list(originals), n=1)), None
    )


def _normalized(topic: str) -> str:
    return topic.strip("/").casefold()


def _unpublished_findings(facts: TopicFacts) -> Iterator[Finding]:
    message = _("{topic} has no publisher.").format(topic=facts.topic)
    similar = closest_topic(facts.topic, facts.other_topics)
    service = facts.topic if facts.topic in facts.services else ""
    if similar is not None:
        yield Finding("topic:near", "error", message, _similar_name_text(facts, similar), instead=similar)
    elif service:
        hint = _("A service has this name. Services reply to calls; they don't publish.")
        yield Finding("topic:service", "error", message, hint, instead=service)
    else:
        hint = _("Start the program that publishes it. Topics published now: {topics}.")
        topics = sorted(
            name for name in facts.other_topics if not name.startswith("/nep/")
        )  # hide nep's own topics
        listed_topics = topics[:_MAX_NAMES]
        if not listed_topics:
            hint = _("Start the program that publishes it. No other topics are published either.")
        more_count = len(topics) - len(listed_topics)
        names = [*listed_topics, _("{count} more").format(count=more_count)] if more_count else listed_topics
        yield Finding(
            "topic:nobody", "error", message, hint.format(topics=format_list(names) if names else "")
        )
    if facts.is_shared:
        yield Finding(
            "topic:shared",
            "info",
            _("Other computers can connect to the master at {address}.").format(address=facts.address),
            _(
                "Is the program on another computer? Set its NEP_MASTER to the master's network address, "
                "and allow NEP Studio (Python) in the firewall of the master's computer."
            ),
        )
    elif is_loopback(facts.address):
        yield Finding(
            "topic:closed",
            "info",
            _("The master at {address} accepts only programs on this computer.").format(
                address=facts.address
            ),
            _("Is the program on another computer? Allow other computers to connect."),
        )


def _similar_name_text(facts: TopicFacts, similar: str) -> str:
    rate_hz = facts.other_topics[similar]
    if rate_hz is None:
        return _("Did you mean {topic}?").format(topic=similar)
    template = _("Did you mean {topic}? Its publishers send {rate} messages per second.")
    return template.format(topic=similar, rate=number(rate_hz, ".3g" if rate_hz < 100 else ".0f"))


def _publisher_findings(facts: TopicFacts, publisher: PublisherFact) -> Iterator[Finding]:
    if publisher.generation in UNSUPPORTED_VERSIONS:
        yield unsupported_finding(f"topic:version:{publisher.node}", publisher.node, publisher.generation)
    elif publisher.reach_failure:
        yield _unreachable_finding(publisher)
    elif not facts.received:
        yield from _silence_findings(facts, publisher)


def _unreachable_finding(publisher: PublisherFact) -> Finding:
    address = publisher.endpoint.removeprefix("tcp://")
    if publisher.reach_failure == "elsewhere":
        message = _("“{node}” can be reached only from its own computer, {host}.")
        fix = _(
            "Its NEP_MASTER is an address that works only on that computer. Restart it with the "
            "master's network address as NEP_MASTER."
        )
    elif publisher.reach_failure == "timeout":
        message = _("“{node}” publishes at {place} ({host}), but that address doesn't respond.")
        fix = _(
            "A firewall blocks the connection, or the computers are on different networks. Allow "
            "Python in the firewall of {host}."
        )
    elif publisher.reach_failure == "refused":
        message = _("“{node}” published at {place} ({host}), but nothing is listening there now.")
        fix = _("The program has stopped or isn't responding. Start it again.")
    else:
        message = _("“{node}” publishes at {place} ({host}), but this computer has no route to that address.")
        fix = _("Check that both computers are on the same network.")
    fields = {"node": publisher.node, "host": publisher.host, "place": address}
    return Finding(f"topic:address:{publisher.node}", "error", message.format(**fields), fix.format(**fields))


def _silence_findings(facts: TopicFacts, publisher: PublisherFact) -> Iterator[Finding]:
    quiet_s = facts.now_s - publisher.last_message_s if publisher.last_message_s is not None else None
    if quiet_s is not None and quiet_s < max(MIN_SILENCE_S, facts.listen_duration_s):
        return  # it sends; `_arrival_findings` reports missing messages
    if quiet_s is None and publisher.sent:
        return
    if quiet_s is None or publisher.last_message_s is None:
        message = _("“{node}” is connected but has sent nothing on {topic} yet.")
        fix = _("Check what that program is waiting for.")
    else:
        message = _("“{node}” is connected but has sent nothing on {topic} for {ago}.")
        time_text = time.strftime("%H:%M:%S", time.localtime(publisher.last_message_s))
        template = _("Its last message was at {at}. Check what that program is waiting for.")
        if publisher.sent:
            template = _(
                "Its last message was number {count}, at {at}. Check what that program is waiting for."
            )
        fix = template.format(count=number(publisher.sent or 0, ".0f"), at=time_text)
    remedy = next(iter(publisher.remedies), "")
    if remedy:
        fix += " " + _("Call its service “{service}” to restart it.").format(service=remedy)
    yield Finding(
        f"topic:silent:{publisher.node}",
        "error",
        message.format(node=publisher.node, topic=facts.topic, ago=duration_text(quiet_s or 0.0)),
        fix,
        instead=remedy,
    )


def _alert_finding(id: str, message: str, hint: str) -> Finding:
    return Finding(id, "error", message if message.endswith(".") else f"{message}.", hint)


def _arrival_findings(facts: TopicFacts, *, is_explained: bool) -> Iterator[Finding]:
    if facts.decode_problem:
        yield Finding(
            "topic:unreadable",
            "error",
            _("Messages on {topic} arrive but can't be read: {reason}.").format(
                topic=facts.topic, reason=facts.decode_problem
            ),
            _("Check the raw bytes in the Inspector, and the program that sends them: {nodes}.").format(
                nodes=_publisher_text(facts.publishers)
            ),
        )
    elif facts.received:
        template = _("Messages on {topic} arrive and can be read.")
        yield Finding("topic", "ok", template.format(topic=facts.topic))
    elif facts.rejected:
        yield Finding(
            "topic:wire",
            "error",
            _("Messages on {topic} come from a version of NEP that this version can't read.").format(
                topic=facts.topic
            ),
            _("Use the same version of NEP in all programs: {nodes}.").format(
                nodes=_publisher_text(facts.publishers)
            ),
        )
    elif not is_explained:
        yield Finding(
            "topic:blocked",
            "error",
            _("{topic} is published by {nodes}, but no messages were received in {seconds} s.").format(
                topic=facts.topic,
                nodes=_publisher_text(facts.publishers),
                seconds=number(facts.listen_duration_s, ".1f"),
            ),
            _("This computer or its network may be overloaded, or a firewall blocks the messages."),
        )


def _publisher_text(publishers: Sequence[PublisherFact]) -> str:
    locations = dict.fromkeys(f"{each.node} ({each.host})" for each in publishers)
    return format_list(list(locations)[:_MAX_NAMES])
