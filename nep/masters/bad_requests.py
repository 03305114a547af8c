"""Malformed requests to the master: counts per sender, log messages and alerts."""

from __future__ import annotations

import logging
from collections import OrderedDict
from dataclasses import dataclass

from nep.i18n import _, lazy, ngettext
from nep.protocol.graph_view import Alert
from nep.system.log_rarely import is_logged
from nep.text import escaped, shortened

_logger = logging.getLogger("nep.master")
_LOG_BURST, _LOG_RATE_HZ = 10.0, 0.2
"""Burst and rate (per second) of log lines. Limited, because each connection may be another sender."""
_MAX_SENDERS = 100
"""Maximum number of senders.

When it is exceeded, the sender that has been inactive for longest is evicted.
"""
_MAX_ALERTS = 5
"""Maximum number of senders with a separate alert; all other senders share one alert."""
_ALERT_DURATION_S = 10.0
"""Duration of an alert in seconds after the newest malformed request."""
_ALERT_INTERVAL_S = 1.0
"""Minimum time in seconds between changes of the alerts, which are sent to all observers of the graph."""
_MAX_REASON_LENGTH = 200
"""Maximum length of a reason in characters; it may quote untrusted input."""
_HINT = lazy(
    "The sender may use another version of nep, or not be a nep program. Check which programs connect "
    "to the master's port."
)


@dataclass
class _Sender:
    name: str
    count: int = 0
    reason: str = ""
    last_request_at: float = 0.0


class BadRequestCounter:
    """Counter of malformed requests by sender. Not thread-safe; used only by the master's thread.

    All times (`now`) are monotonic, in seconds.
    """

    def __init__(self) -> None:
        self._senders: OrderedDict[str, _Sender] = OrderedDict()
        self._alerts: tuple[Alert, ...] = ()
        self._alerts_at = 0.0
        self._log_tokens, self._refilled_at = _LOG_BURST, 0.0

    def add(self, sender: str, name: str, reason: str, now: float) -> None:
        """Count a malformed request; log the first, tenth, hundredth, … of each sender.

        Args:
            sender: Key of the sender, as returned by `describe_sender`.
            name: Name of the sender in messages.
            reason: Reason why the request is malformed.
            now: Current time.
        """
        entry = self._senders.pop(sender, None) or _Sender(name)
        self._senders[sender] = entry
        entry.name, entry.reason, entry.last_request_at = (
            name,
            escaped(shortened(reason, _MAX_REASON_LENGTH)),
            now,
        )
        entry.count += 1
        self._log_tokens = min(_LOG_BURST, self._log_tokens + (now - self._refilled_at) * _LOG_RATE_HZ)
        self._refilled_at = now
        if is_logged(entry.count) and self._log_tokens >= 1.0:
            self._log_tokens -= 1.0
            _logger.warning("%s", _alert_text(entry))
        while len(self._senders) > _MAX_SENDERS:
            self._senders.popitem(last=False)

    def alerts(self, now: float) -> tuple[Alert, ...]:
        """Return alerts about requests of the last 10 seconds.

        There is one alert for each of the most recent senders, and one for all others. The result is
        updated once per second.
        """
        if (self._senders or self._alerts) and now >= self._alerts_at + _ALERT_INTERVAL_S:
            self._alerts_at = now
            self._alerts = self._current_alerts(now)
        return self._alerts

    def _current_alerts(self, now: float) -> tuple[Alert, ...]:
        recent = [
            (sender, entry)
            for sender, entry in reversed(self._senders.items())
            if now - entry.last_request_at < _ALERT_DURATION_S
        ]
        alerts = [
            Alert(f"request:{sender}", _alert_text(entry), _(_HINT)) for sender, entry in recent[:_MAX_ALERTS]
        ]
        if len(recent) > _MAX_ALERTS:
            text = ngettext(
                "{count} more program sends requests that the master can't read",
                "{count} more programs send requests that the master can't read",
                len(recent) - _MAX_ALERTS,
            ).format(count=len(recent) - _MAX_ALERTS)
            alerts.append(Alert("request:", text, _(_HINT)))
        return tuple(sorted(alerts, key=lambda each: each.id))


def describe_sender(node_id: str, node_name: str, peer: str) -> tuple[str, str]:
    """Return the key by which a sender's requests are counted, and the sender's name in messages.

    Requests of a registered node are counted by node. Other requests are counted by computer, because
    every new connection would otherwise be a new sender.

    Args:
        node_id: Id of the node that sent the request, or "" if unknown.
        node_name: Name of the node.
        peer: Host of the sender, or "" if unknown.
    """
    if node_id:
        return node_id, f"“{node_name}”"
    if not peer:
        return peer, _("A program on an unknown computer")
    return peer, _("A program on {host}").format(host=peer)


def _alert_text(sender: _Sender) -> str:
    template = ngettext(
        "{program} sent a request that the master can't read: {reason}",
        "{program} sent {count} requests that the master can't read: {reason}",
        sender.count,
    )
    return template.format(program=sender.name, count=sender.count, reason=sender.reason)
