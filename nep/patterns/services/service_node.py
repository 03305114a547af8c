"""ServiceNode: what `Node` makes of services."""

from __future__ import annotations

from abc import ABC, abstractmethod

from nep.backends.base import Transport
from nep.backends.connection import Configuration
from nep.patterns.services.client import Client
from nep.patterns.services.owned import OwnedServices
from nep.patterns.services.server import Callback, Server
from nep.patterns.services.survey import Respondent, Surveyor
from nep.patterns.services.typed import call_types
from nep.system.arguments import seconds

__all__ = ["ServiceNode"]


class ServiceNode(ABC):
    """A node's servers, clients, respondents and surveyors."""

    _services: OwnedServices

    @abstractmethod
    def _open_transport(self) -> Transport:
        """Raises `ClosedError`."""

    @abstractmethod
    def _configured(self, configuration: object) -> Configuration:
        """The node's own one for None. Raises `ValueError` for what is none."""

    def new_server(
        self,
        service: str,
        callback: Callback | None = None,
        configuration: Configuration | None = None,
        *,
        threads: int = 0,
        msg_type: str = "json",
        request: type | None = None,
        answer: type | None = None,
    ) -> Server:
        """A server of a service: `callback(request)` gives the answer, in the thread that calls `spin`.

        With `threads` it runs in so many threads of the server's own instead, and nobody needs to spin. What
        it raises is raised at the client, as `ServiceError`. Without a callback, `Server.listen_info` and
        `send_info` answer. With `node.direct(ip, port)` it serves the original NEP's `client` at that port.
        `msg_type` is for back ends whose services have types ("ros": "std_srvs/SetBool"); others answer each
        client in its own. `request`: a dataclass or TypedDict (docs/types.md), of which the callback is given
        instances; a request that does not fit is refused. `answer`: one of which it gives instances. Raises
        as `new_pub` does.
        """
        self._open_transport()
        types = call_types(request=request, answer=answer)
        configured = self._configured(configuration)
        return self._services.server(service, callback, configured, threads, msg_type, types)

    def new_client(
        self,
        service: str,
        configuration: Configuration | None = None,
        *,
        msg_type: str = "json",
        timeout_s: float | None = 5.0,
        request: type | None = None,
        answer: type | None = None,
    ) -> Client:
        """A client of a service; a server need not be there yet.

        `timeout_s` is how long its calls wait for a server and their answer, unless they say otherwise.
        `msg_type="msgpack"` carries bytes, too. With `node.direct(ip, port)` it calls the original NEP's
        `server` at that port. `request`: a dataclass or TypedDict (docs/types.md), of which it is called with
        instances; all else is an `EncodeError`. `answer`: one of which the answers are instances; what does
        not fit is a `DecodeError`. Raises as `new_pub` does.
        """
        self._open_transport()
        types = call_types(request=request, answer=answer)
        return self._services.client(service, self._configured(configuration), msg_type, timeout_s, types)

    def new_respondent(
        self,
        survey: str,
        callback: Callback | None = None,
        configuration: Configuration | None = None,
        *,
        threads: int = 0,
        question: type | None = None,
        answer: type | None = None,
    ) -> Respondent:
        """Answers the questions of a survey, as `new_server` answers calls: there may be any number of them.

        Without a callback, `Respondent.listen_json` and `send_json` answer. `question`: what questions are
        instances of. `answer`: what answers are. Both as for `new_server`. Raises as `new_pub` does.
        """
        self._open_transport()
        types = call_types(question=question, answer=answer)
        return self._services.respondent(survey, callback, self._configured(configuration), threads, types)

    def new_surveyor(
        self,
        survey: str,
        timeout: float | None = 1000,
        configuration: Configuration | None = None,
        *,
        msg_type: str = "json",
        question: type | None = None,
        answer: type | None = None,
    ) -> Surveyor:
        """Asks all respondents of a survey at once; see `Surveyor.ask`.

        `timeout`: so many milliseconds, as in the original NEP, it waits for answers, unless a question says
        otherwise; None: until all have answered. `question`: what questions are instances of. `answer`: what
        answers are; one that does not fit counts as none. Raises as `new_pub` does.
        """
        self._open_transport()
        types = call_types(question=question, answer=answer)
        timeout_s = seconds("timeout", timeout)
        timeout_s = None if timeout_s is None else timeout_s / 1000
        return self._services.surveyor(survey, self._configured(configuration), msg_type, timeout_s, types)
