"""Exceptions of nep. Each has its details as attributes; the message is formatted from them.

    NepError
    ├── WaitTimeoutError        a time limit passed
    │   ├── ServiceTimeoutError     a server did not reply in time
    │   └── NoServerError           a service has no server
    ├── ServiceError            the callback of a server raised an exception
    ├── ServerGoneError         a server stopped during a call
    ├── ClosedError             the object is closed
    ├── ParameterError          invalid value of a parameter, or unknown parameter
    ├── NoValueError            a blackboard has no (recent) value for a key
    ├── BadKeyError             invalid key of a blackboard
    ├── BadValueError           value that a blackboard can't store
    ├── BadTopicError           invalid topic name
    ├── BadNameError            invalid node name
    ├── UnknownBackendError     unknown back end
    ├── BackendUnavailableError a package that the back end needs is not installed
    ├── PluginsMissingError     a plug-in package is empty (left out of a frozen program)
    ├── MasterUnreachable       no master replies
    ├── RequestRefusedError     the master or a server rejected a request
    ├── AddressInUseError       another program uses the address
    ├── TooManyFilesError       the process reached its open-file limit
    ├── EncodeError             a payload can't be encoded
    ├── DecodeError             received bytes can't be decoded
    │   └── WireError               received frames violate the native wire format
    ├── RecordingError          a recording can't be written or read
    │   └── RecordingTooLargeError  reading a recording would exceed a limit
    └── RecordingsUnavailableError  packages that recordings need are not installed

`WrongTypeError` is raised for arguments of a wrong type; it is a `TypeError` and a `ValueError`.

Messages are in lower case, without a full stop, quote values, and name the next step after a semicolon.
"""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from nep.i18n import _
from nep.text import escaped, quotable, shortened

_MAX_WORD_LENGTH = 200
_MAX_REASON_LENGTH = 500
"""Maximum length in characters of a reason received from another program."""


def did_you_mean(word: str, known_names: Sequence[str]) -> str:
    """Return a hint for an unknown word, for use in an error message.

    The hint is "did you mean 'zeromq'?" if a known word is similar, else "known names: 'zeromq',
    'memory'".

    Args:
        word: The unknown word.
        known_names: The known words.
    """
    nearest_name = nearest(word, known_names)
    if nearest_name is not None:
        return _("did you mean '{near}'?").format(near=nearest_name)
    return _("known names: {names}").format(names=", ".join(f"'{name}'" for name in known_names))


def nearest(word: str, known_names: Sequence[str]) -> str | None:
    """Return the known word most similar to `word`.

    Returns None if none is similar, or if `word` has more than 200 characters.
    """
    if len(word) > _MAX_WORD_LENGTH:  # the cost of the comparison grows with the square of the length
        return None
    return next(iter(get_close_matches(word, known_names, n=1)), None)


class NepError(Exception):
    """Base class of all exceptions that nep raises.

        try:
            node.new_pub("position")
        except nep.NepError as error:
            print(error)

    The attributes of each subclass contain its details.
    """


class WaitTimeoutError(NepError):
    """A time limit passed before the expected event.

    Attributes:
        what: Expected event, for the message.
        timeout_s: Time limit in seconds.
    """

    def __init__(self, what: str, timeout_s: float) -> None:
        self.what: str = what
        self.timeout_s = timeout_s
        super().__init__(
            _("timed out after {seconds:g} s while waiting for {what}").format(what=what, seconds=timeout_s)
        )


class ServiceTimeoutError(WaitTimeoutError):
    """The server did not reply in time. It may still be executing the call.

    Attributes:
        service: The name of the service.
        timeout_s: The time limit in seconds.
        what: The expected reply, for the message.
    """

    def __init__(self, service: str, timeout_s: float) -> None:
        self.service = service
        super().__init__(_("a reply from '{service}'").format(service=service), timeout_s)


class NoServerError(WaitTimeoutError):
    """No server of the service was found in time.

    Attributes:
        service: The name of the service.
        timeout_s: The time limit in seconds.
        what: The name of the service.
        known: Names of the services that have a server.
        address: The expected fixed address, or "" for services registered at a master.
    """

    def __init__(self, service: str, timeout_s: float, known: Sequence[str] = (), address: str = "") -> None:
        self.service = service
        self.address = address
        self.known = tuple(known)
        super().__init__(service, timeout_s)
        nearest_name = nearest(service, self.known)
        if address:
            step = _("start it, or check the address '{address}'").format(address=address)
        elif service in self.known:
            step = _(
                "the server can't be reached; programs of the original NEP accept calls only from their "
                "own computer"
            )
        elif nearest_name is not None:
            step = _("did you mean '{near}'?").format(near=nearest_name)
        else:
            step = _("'nep service list' shows all services")
        self.args = (
            _("no server for '{service}' within {seconds:g} s; {step}").format(
                service=service, seconds=timeout_s, step=step
            ),
        )


class ParameterError(NepError, ValueError):
    """A parameter does not exist, or can't have the requested value.

    Attributes:
        name: The name of the parameter.
        value: The rejected value as Python source, or "" when no value is involved.
        reason: The reason for the rejection.
    """

    def __init__(self, name: str, value: str, reason: str) -> None:
        self.name = name
        self.value = value
        self.reason = reason
        super().__init__(
            _("the parameter '{name}' can't be {value}: {reason}").format(
                name=name, value=value, reason=reason
            )
            if value
            else _("can't use the parameter '{name}': {reason}").format(name=name, reason=reason)
        )


class NoValueError(NepError, KeyError):
    """A blackboard has no value for a key, or none that is recent enough. Also a `KeyError`.

    Attributes:
        key: The requested key.
        known: Existing keys.
    """

    def __init__(self, key: str, known: Sequence[str] = ()) -> None:
        self.key = key
        self.known = tuple(known)
        nearest_name = nearest(key, self.known)
        step = (
            _("did you mean '{near}'?").format(near=nearest_name)
            if nearest_name is not None
            else _("'keys' lists the existing keys")
        )
        super().__init__(
            _("the blackboard has no '{key}'; {step}").format(key=escaped(shortened(key, 200)), step=step)
        )

    def __str__(self) -> str:
        return str(self.args[0])  # `KeyError` would show the message in quotes


class BadKeyError(NepError, ValueError):
    """The key is invalid on a blackboard. Also a `ValueError`.

    Attributes:
        key: The rejected key.
        reason: The reason for the rejection.
    """

    def __init__(self, key: str, reason: str) -> None:
        self.key = key
        self.reason = reason
        super().__init__(
            _("'{key}' isn't a valid key: {reason}").format(key=escaped(shortened(key, 200)), reason=reason)
        )


class BadValueError(NepError, ValueError):
    """A blackboard can't store the value. Also a `ValueError`.

    Attributes:
        key: The key of the rejected value.
        reason: The reason for the rejection.
    """

    def __init__(self, key: str, reason: str) -> None:
        self.key = key
        self.reason = reason
        super().__init__(
            _("'{key}' can't have this value: {reason}").format(
                key=escaped(shortened(key, 200)), reason=reason
            )
        )


class ServiceError(NepError):
    """The callback of a server raised an exception.

    Attributes:
        service: The name of the service.
        kind: The class name of the server's exception.
        reason: The message of the server's exception.
    """

    def __init__(self, service: str, kind: str, reason: str) -> None:
        self.service = service
        self.kind = kind
        self.reason = reason
        super().__init__(
            _("the server of '{service}' failed: {kind}: {reason}").format(
                service=service, kind=kind, reason=reason
            )
            if reason
            else _("the server of '{service}' failed: {kind}").format(service=service, kind=kind)
        )


class ServerGoneError(NepError):
    """The server stopped during a call. It is unknown whether the call was executed.

    Attributes:
        service: The name of the service.
    """

    def __init__(self, service: str) -> None:
        self.service = service
        super().__init__(
            _(
                "the server of '{service}' stopped during the call; check whether the call was executed "
                "before you call again"
            ).format(service=service)
        )


class ClosedError(NepError):
    """The object is closed.

    Attributes:
        what: A description of the object, such as "subscriber 'example'".
        is_forked: True in a forked child process, when the object belongs to the parent process.
    """

    def __init__(self, what: str, *, is_forked: bool = False) -> None:
        self.what = what
        self.is_forked = is_forked
        if is_forked:
            super().__init__(
                _(
                    "{what} belongs to the parent process and can't be used after a fork; create a new "
                    "node in "
                    "the child process"
                ).format(what=what)
            )
        else:
            super().__init__(_("{what} is closed; create a new one").format(what=what))


class BadTopicError(NepError, ValueError):
    """The topic name is invalid. Also a `ValueError`.

    Attributes:
        topic: The rejected name.
        reason: The rule that the name breaks.
    """

    def __init__(self, topic: str, reason: str) -> None:
        self.topic = topic
        self.reason = reason
        super().__init__(
            _("'{topic}' isn't a valid topic name: {reason}").format(
                topic=escaped(shortened(topic, 200)), reason=reason
            )
        )


class BadNameError(NepError, ValueError):
    """The node name is invalid. Also a `ValueError`.

    Attributes:
        name: The rejected name.
        reason: The rule that the name breaks.
    """

    def __init__(self, name: str, reason: str) -> None:
        self.name = name
        self.reason = reason
        super().__init__(
            _("'{name}' isn't a valid node name: {reason}").format(
                name=escaped(shortened(name, 200)), reason=reason
            )
        )


class UnknownBackendError(NepError):
    """The requested back end does not exist.

    Attributes:
        name: The requested name.
        known: Names of all back ends.
    """

    def __init__(self, name: str, known: Sequence[str]) -> None:
        self.name = name
        self.known = tuple(known)
        super().__init__(
            _("unknown back end '{name}'; {did_you_mean}").format(
                name=quotable(name), did_you_mean=did_you_mean(name.lower(), self.known)
            )
        )


class BackendUnavailableError(NepError):
    """A package that the back end needs is not installed.

    Attributes:
        name: The name of the back end.
        needs: Instructions for the installation.
    """

    def __init__(self, name: str, needs: str) -> None:
        self.name = name
        self.needs = needs
        super().__init__(_("the back end '{name}' isn't installed; {needs}").format(name=name, needs=needs))


class PluginsMissingError(NepError):
    """No module of the plug-in package defines the attribute: the package is empty or was not shipped.

    Attributes:
        package: The dotted name of the package.
        attribute: The name that plug-ins define.
    """

    def __init__(self, package: str, attribute: str) -> None:
        self.package = package
        self.attribute = attribute
        super().__init__(
            _(
                "no module of '{package}' defines '{attribute}'; include the package when you freeze "
                "this program"
            ).format(package=package, attribute=attribute)
        )


class MasterUnreachable(NepError):  # noqa: N818 - the name is part of the wire specification
    """No master replied, or the master's host name can't be resolved.

    Attributes:
        address: The address of the master.
        waited_s: The time waited for a reply, in seconds.
        is_known: False when the host name can't be resolved.
    """

    def __init__(self, address: str, waited_s: float, *, is_known: bool = True) -> None:
        self.address = address
        self.waited_s = waited_s
        self.is_known = is_known
        if not is_known:
            super().__init__(
                _("unknown computer '{address}'; check the spelling, or use its IP address").format(
                    address=address.rpartition(":")[0]
                ),
            )
            return
        super().__init__(
            _("no master replied at '{address}' (waited {seconds:g} s); start one with 'nep master'").format(
                address=address, seconds=waited_s
            ),
        )


class RequestRefusedError(NepError):
    """The master or a server rejected a request.

    Attributes:
        reason: The reason given in the reply.
    """

    def __init__(self, reason: str) -> None:
        self.reason = escaped(shortened(reason, _MAX_REASON_LENGTH))
        super().__init__(self.reason)


class AddressInUseError(NepError):
    """The address is used by another program, or does not belong to this computer.

    Attributes:
        address: The address; "HOST:*" when no port of the host is free.
    """

    def __init__(self, address: str, *, is_own: bool = True) -> None:
        self.address = address
        if not is_own:
            super().__init__(
                _(
                    "'{address}' isn't an address of this computer; use one of its addresses, or '127.0.0.1'"
                ).format(address=address)
            )
            return
        if address.endswith(":*"):
            super().__init__(
                _("no port of '{address}' is free; close programs that have many connections").format(
                    address=address[:-2]
                )
            )
            return
        super().__init__(
            _("'{address}' is in use by another program; close that program or choose another port").format(
                address=address
            )
        )


class TooManyFilesError(NepError):
    """The process has reached its limit of open files and sockets.

    Attributes:
        what: The object that could not be opened.
        opened: The number of open files, or None if unknown.
        limit: The limit of open files, or None if unknown.
    """

    def __init__(self, what: str, opened: int | None, limit: int | None) -> None:
        self.what = what
        self.opened = opened
        self.limit = limit
        if opened is not None and limit is not None:
            usage = _("this program has {opened} of {limit} files open").format(opened=opened, limit=limit)
        else:
            usage = _("this program has reached its limit of open files")
        step = _(
            "close unused nodes and files, or raise the limit with 'ulimit -n {files}' before you start it"
        )
        step = step.format(files=max(8192, 2 * (limit or 0)))
        super().__init__(_("can't create {what}: {has}; {step}").format(what=what, has=usage, step=step))


class EncodeError(NepError, ValueError):
    """A payload can't be encoded as its message type. Also a `ValueError`.

    Attributes:
        codec: The name of the codec, such as "json".
        kind: The Python type of the payload.
        reason: The reason for the failure.
        place: The path to the offending value, such as "pose.x", or "" if unknown.
    """

    def __init__(self, codec: str, kind: str, reason: str, place: str = "") -> None:
        self.codec = codec
        self.kind = kind
        self.place = place
        self.reason = reason
        super().__init__(
            _("can't encode a '{kind}' as '{codec}': {reason}").format(kind=kind, codec=codec, reason=reason)
        )


class DecodeError(NepError, ValueError):
    """Received bytes can't be decoded. Also a `ValueError`.

    Attributes:
        codec: The name of the codec, such as "json".
        size_bytes: The size of the received data.
        reason: The reason for the failure.
    """

    def __init__(self, codec: str, size_bytes: int, reason: str) -> None:
        self.codec = codec
        self.size_bytes = size_bytes
        self.reason = reason = escaped(shortened(reason, _MAX_REASON_LENGTH))  # may quote untrusted input
        super().__init__(
            _("can't decode {size_bytes} bytes as '{codec}': {reason}").format(
                size_bytes=size_bytes, codec=codec, reason=reason
            )
        )


class WireError(DecodeError):
    """Received frames or a request violate the specification of the native wire (docs/wire.md).

    Attributes:
        code: The error code, which is independent of language and version; see the table in docs/wire.md.
    """

    def __init__(self, reason: str, size_bytes: int = 0, *, code: str = "malformed") -> None:
        self.code = code
        super().__init__("nep wire", size_bytes, reason)


class RecordingError(NepError):
    """A recording can't be written or read.

    Attributes:
        path: The path of the file.
        reason: The reason for the failure.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(
            _("can't use the recording '{path}': {reason}").format(path=escaped(path), reason=reason)
        )


class RecordingTooLargeError(RecordingError):
    """Reading the recording would exceed a limit of size or work; `reason` names the limit."""


class RecordingsUnavailableError(NepError):
    """Packages that recordings need are not installed.

    Attributes:
        needs: Instructions for the installation.
    """

    def __init__(self, needs: str) -> None:
        self.needs = needs
        super().__init__(_("recordings need packages that aren't installed; {needs}").format(needs=needs))


class WrongTypeError(TypeError, ValueError):
    """An argument has the wrong type. Also a `ValueError`, like the errors for other invalid arguments."""
