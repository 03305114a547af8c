"""Execution of alarm actions that call services or publish messages.

Clients and publishers are cached.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

from nep.errors import NepError, NoServerError, WaitTimeoutError
from nep.i18n import _, number
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.patterns.services.client import Client
from nep.programs.alarms.alarms import DoneCallback
from nep.programs.alarms.rule import AlarmAction

CALL_TIMEOUT_S = 5.0
"""Time limit of a service call in seconds."""
_MAX_CACHED = 50


def _allow_all(_node: Node, _topic: str, _msg_type: str) -> str:
    return ""


class AlarmCommands:
    """Executor of the alarm actions "call" and "send". Thread-safe.

    Args:
        denial_reason: Returns the reason why a node may not publish (node, topic, message type); "" if it
            may.
    """

    def __init__(self, denial_reason: Callable[[Node, str, str], str] = _allow_all) -> None:
        self._denial_reason = denial_reason
        self._lock = threading.Lock()
        self._clients: dict[str, Client] = {}
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._node: Node | None = None

    def start_action(self, node: Node, action: AlarmAction, on_done: DoneCallback) -> None:
        """Start an action with a node; `on_done` receives the result.

        The call waits for the handshake of a new publisher, but not for the reply of a service. Errors are
        passed to `on_done`, not raised.
        """
        try:
            with self._lock:
                self._use_node(node)
                if action.kind == "call":
                    self._call(node, action, on_done)
                    return
                publisher = self._publisher(node, action)
                reason = self._denial_reason(
                    node, action.name, action.msg_type
                )  # checked last: creating the publisher takes time
                if reason:
                    on_done(False, _("not sent: {reason}").format(reason=reason))
                    return
                publisher.publish(action.payload)
                has_subscribers = publisher.subscribers > 0
        except NepError as error:
            on_done(False, str(error))
            return
        template = _("sent to {topic}") if has_subscribers else _("{topic} has no subscribers")
        on_done(has_subscribers, template.format(topic=action.name))

    def close(self) -> None:
        """Discard the cached clients and publishers, which are closed with their node."""
        with self._lock:
            self._clients.clear()
            self._publishers.clear()

    def _use_node(self, node: Node) -> None:
        if node is not self._node:
            self._node = node
            self._clients.clear()
            self._publishers.clear()

    def _call(self, node: Node, action: AlarmAction, on_done: DoneCallback) -> None:
        client = self._clients.get(action.name)
        if client is None:
            if len(self._clients) >= _MAX_CACHED:
                self._clients.pop(next(iter(self._clients))).close()
            client = self._clients[action.name] = node.new_client(action.name, timeout_s=CALL_TIMEOUT_S)
        client.call_async(action.payload).add_done_callback(_reply_handler(action.name, on_done))

    def _publisher(self, node: Node, action: AlarmAction) -> Publisher:
        key = (action.name, action.msg_type)
        publisher = self._publishers.get(key)
        if publisher is None:
            if len(self._publishers) >= _MAX_CACHED:
                self._publishers.pop(next(iter(self._publishers))).close(0.0)
            publisher = self._publishers[key] = node.new_pub(action.name, action.msg_type)
        return publisher


def _reply_handler(service: str, on_done: DoneCallback) -> Callable[[Future[object]], None]:
    def on_reply(future: Future[object]) -> None:
        error = None if future.cancelled() else future.exception()
        if isinstance(error, NoServerError):
            on_done(False, _("{service} has no server").format(service=service))
        elif isinstance(error, WaitTimeoutError):
            template = _("{service} didn't reply within {seconds} s")
            on_done(False, template.format(service=service, seconds=number(CALL_TIMEOUT_S)))
        elif error is not None or future.cancelled():
            on_done(False, _("{service}: {reason}").format(service=service, reason=str(error or "")))
        else:
            on_done(True, _("{service} replied").format(service=service))

    return on_reply
