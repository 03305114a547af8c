"""Surveyor that uses one client per respondent."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from nep.backends.services import ClientSpec, OpenCall, Outcome
from nep.backends.zeromq.services.client import SocketClient
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.requests import RemotePublisher, SubscriberCount, clamp_count

_logger = logging.getLogger("nep")

OutcomeCallback = Callable[[Outcome], None]


class _SentCall(NamedTuple):
    client: SocketClient
    call: OpenCall

    @property
    def number(self) -> int:
        return self.call.number


class SurveyClient:
    """Surveyor that uses one client per respondent.

    Args:
        spec: Settings of the surveyor.
        new_client: Creates the client for a respondent's endpoint.
        closer: Closes the surveyor.
    """

    def __init__(
        self,
        spec: ClientSpec,
        new_client: Callable[[str], SocketClient],
        closer: Callable[[SurveyClient], None],
    ) -> None:
        self.spec = spec
        self.is_closed = False
        self._new_client = new_client
        self._closer = closer
        self._lock = threading.Lock()
        self._clients: dict[int, SocketClient] = {}
        self._removed_clients: list[SocketClient] = []
        """Clients of respondents that are no longer listed; their last replies are still accepted."""
        self._replied = self._failed = self._late = 0
        """Statistics of closed clients."""

    # ---- calling, in any thread

    @property
    def respondents(self) -> int:
        """Number of respondents that the master lists."""
        return len(self._clients)

    @property
    def late(self) -> int:
        """Number of replies that arrived after their call had timed out or was cancelled."""
        with self._lock:
            return self._late + sum(each.late for each in self._all_clients())

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> list[OpenCall]:
        """Send a request to all listed respondents. See `SurveyTransport.start_survey`."""
        self._close_idle_removed_clients()
        with self._lock:
            if self.is_closed:
                raise self._closed_error()
            clients = list(self._clients.values())
        sent_calls: list[OpenCall] = []
        try:
            for client in clients:
                try:
                    sent_calls.append(_SentCall(client, client.start_call(data, timeout_s, callback)))
                except ClosedError:  # left in the meantime
                    continue
        except BaseException:
            self.cancel_all(sent_calls)
            raise
        return sent_calls

    def cancel_all(self, calls: Sequence[OpenCall]) -> None:
        """Cancel several calls; their callbacks aren't called."""
        for sent_call in calls:
            if isinstance(sent_call, _SentCall):
                sent_call.client.cancel(sent_call.call)

    def _all_clients(self) -> list[SocketClient]:
        return [*self._clients.values(), *self._removed_clients]

    def _close_idle_removed_clients(self) -> None:
        with self._lock:
            idle_clients = [each for each in self._removed_clients if not each.is_busy]
            self._removed_clients = [each for each in self._removed_clients if each not in idle_clients]
        self._close_clients(idle_clients)

    def _close_clients(self, clients: Iterable[SocketClient]) -> None:
        for client in clients:
            client.close()
            counts = client.counts()
            with self._lock:
                self._replied += counts.received or 0
                self._failed += counts.lost or 0
                self._late += client.late

    # ---- in the I/O thread: updates from the session

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Add respondents that the master lists."""
        with self._lock:
            for remote in remotes:
                self._add_respondent(remote.publisher.id, remote.publisher.endpoints)

    def _add_respondent(self, respondent: int, endpoints: Sequence[str]) -> None:
        if self.is_closed or not endpoints:
            return
        existing = self._clients.get(respondent)
        if existing is not None and existing.fixed_endpoint == endpoints[0]:
            return
        if existing is not None:
            self._remove_respondent(respondent)
        try:
            self._clients[respondent] = self._new_client(endpoints[0])
        except NepError as error:
            _logger.warning(
                "can't connect to a respondent of '%s' at '%s': %s", self.spec.service, endpoints[0], error
            )

    def _remove_respondent(self, respondent: int) -> None:
        client = self._clients.pop(respondent, None)
        if client is not None:
            client.handle_publisher_removed(0, 0, is_closed=True)
            self._removed_clients.append(client)

    def reconnect_remote(self) -> None:
        """Reconnect to respondents on other computers, because the address of this computer has changed."""
        with self._lock:
            for client in self._clients.values():
                client.reconnect_remote()

    def handle_publisher_removed(self, publisher: int, last_seq: int, *, is_closed: bool) -> None:  # noqa: ARG002 - unused here
        """Handle the removal of a respondent. See `SessionSubscriber.handle_publisher_removed`."""
        with self._lock:
            self._remove_respondent(publisher)

    def reconcile(self, remotes: Iterable[RemotePublisher], topic: str = "") -> None:  # noqa: ARG002 - a service has one
        """Replace the list of respondents."""
        endpoints_by_id = {each.publisher.id: each.publisher.endpoints for each in remotes}
        with self._lock:
            if not endpoints_by_id and any(each.is_connected for each in self._clients.values()):
                return  # the master was restarted, and respondents have yet to register
            for respondent in [each for each in self._clients if each not in endpoints_by_id]:
                self._remove_respondent(respondent)
            for respondent, endpoints in endpoints_by_id.items():
                self._add_respondent(respondent, endpoints)

    def handle_renewal(self, now: float, last_seqs: Mapping[int, int]) -> None:
        """Do nothing, because replies have no sequence numbers."""

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        with self._lock:
            counts = [each.counts() for each in self._all_clients()]
            replied = self._replied + sum(each.received or 0 for each in counts)
            failed = self._failed + sum(each.lost or 0 for each in counts)
        problem = next((each.problem for each in counts if each.problem), "")
        return SubscriberCount(self.spec.id, clamp_count(replied), clamp_count(failed), problem)

    # ---- closing

    def close(self) -> None:
        """Unregister the surveyor; calls in flight fail with `ClosedError`. Idempotent."""
        self._closer(self)

    def release(self) -> None:
        """Close the connections to all respondents."""
        with self._lock:
            self.is_closed = True
            clients = self._all_clients()
            self._clients.clear()
            self._removed_clients.clear()
        self._close_clients(clients)

    def _closed_error(self) -> ClosedError:
        return ClosedError(_("surveyor of '{survey}'").format(survey=self.spec.service))
