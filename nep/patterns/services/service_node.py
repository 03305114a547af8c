"""Methods of `Node` for services and surveys."""

from __future__ import annotations

from abc import ABC, abstractmethod

from nep.backends.base import Transport
from nep.backends.connection import Configuration
from nep.patterns.services.client import Client
from nep.patterns.services.registry import ServiceRegistry
from nep.patterns.services.server import Callback, Server
from nep.patterns.services.survey import Respondent, Surveyor
from nep.patterns.services.typed import call_types
from nep.system.arguments import check_optional_time_limit


class ServiceNode(ABC):
    """Base class of `Node` that contains the methods for services and surveys."""

    _services: ServiceRegistry

    @abstractmethod
    def _open_transport(self) -> Transport:
        """Return the open transport. Raises `ClosedError`."""

    @abstractmethod
    def _resolve_configuration(self, configuration: object) -> Configuration:
        """Return the configuration, or the node's default for None.

        Raises `ValueError` if it is neither `Hybrid` nor `Direct`.
        """

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
        """Create a server of a service.

            node.new_server("add", lambda request: {"sum": request["a"] + request["b"]})
            node.spin()

        Args:
            service: Name of the service.
            callback: Function that receives the request and returns the reply; called by `spin`. Exceptions
                are raised at the client as `ServiceError`. None: use `Server.listen_info` and `send_info`.
            configuration: Result of `hybrid` or `direct`; with `direct` the server also accepts clients of
                the original NEP. Default: the node's master.
            threads: Number of threads that run the callback; 0 runs the callback in the thread that calls
                `spin`.
            msg_type: Service type of back ends with typed services ("ros": "std_srvs/SetBool"). Other back
                ends reply in the type of the request.
            request: Dataclass or TypedDict of the requests (docs/types.md); others are rejected.
            answer: Dataclass or TypedDict of the replies.

        Raises:
            NepError: As `Node.new_pub` does.
            ValueError: An argument is invalid.
        """
        self._open_transport()
        types = call_types(request=request, answer=answer)
        configured = self._resolve_configuration(configuration)
        return self._services.new_server(service, callback, configured, threads, msg_type, types)

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
        """Create a client of a service. The server may start later.

            with node.new_client("add", timeout_s=2.0) as add:
                print(add.call({"a": 1, "b": 2}))

        Args:
            service: Name of the service.
            configuration: Result of `hybrid` or `direct`; with `direct` the client can also call servers of
                the original NEP. Default: the node's master.
            msg_type: "json", or "msgpack" for requests with bytes; or the service type of the back end.
            timeout_s: Default time limit of calls in seconds; None for no limit.
            request: Dataclass or TypedDict of the requests (docs/types.md); others raise `EncodeError`.
            answer: Dataclass or TypedDict of the replies; others raise `DecodeError`.

        Raises:
            NepError: As `Node.new_pub` does.
            ValueError: An argument is invalid.
        """
        self._open_transport()
        types = call_types(request=request, answer=answer)
        return self._services.new_client(
            service, self._resolve_configuration(configuration), msg_type, timeout_s, types
        )

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
        """Create a respondent of a survey. A survey may have any number of respondents.

        Args:
            survey: Name of the survey.
            callback: Function that receives the question and returns the answer. None: use
                `Respondent.listen_json` and `send_json`.
            configuration: As for `new_server`.
            threads: As for `new_server`.
            question: Dataclass or TypedDict of the questions.
            answer: Dataclass or TypedDict of the answers.

        Raises:
            NepError: As `Node.new_pub` does.
            ValueError: An argument is invalid.
        """
        self._open_transport()
        types = call_types(question=question, answer=answer)
        return self._services.new_respondent(
            survey, callback, self._resolve_configuration(configuration), threads, types
        )

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
        """Create a surveyor, which asks all respondents of a survey at once.

            surveyor = node.new_surveyor("battery", timeout=500)
            print(surveyor.ask({"unit": "%"}))

        Args:
            survey: Name of the survey.
            timeout: Default time limit in **milliseconds**, as in the original NEP; None waits for all
                respondents.
            configuration: As for `new_client`.
            msg_type: As for `new_client`.
            question: Dataclass or TypedDict of the questions.
            answer: Dataclass or TypedDict of the answers; others are counted as failures.

        Raises:
            NepError: As `Node.new_pub` does.
            ValueError: An argument is invalid.
        """
        self._open_transport()
        types = call_types(question=question, answer=answer)
        timeout_s = check_optional_time_limit("timeout", timeout)
        timeout_s = None if timeout_s is None else timeout_s / 1000
        return self._services.new_surveyor(
            survey, self._resolve_configuration(configuration), msg_type, timeout_s, types
        )
