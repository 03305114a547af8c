"""The errors of nep. Attributes first; the sentence is made from them.

    NepError
    ├── WaitTimeoutError        nothing came within a time limit
    │   ├── ServiceTimeoutError     a server did not answer a call in time
    │   └── NoServerError           a service had no server
    ├── ServiceError            a server's callback raised
    ├── ServerGoneError         a server ended while it was called
    ├── ClosedError             the object was closed before
    ├── ParameterError          a parameter cannot have a value, or there is none
    ├── NoValueError            a blackboard has nothing of this key
    ├── BadKeyError             a key that a blackboard cannot have
    ├── BadValueError           a value that a blackboard cannot have
    ├── BadTopicError           a topic name that the grammar refuses
    ├── BadNameError            a node's name that the grammar refuses
    ├── UnknownBackendError     no back end has this name
    ├── BackendUnavailableError the back end's package is not installed
    ├── PluginsMissingError     a plug-in package is empty (a frozen build that forgot it)
    ├── MasterUnreachable       no master answers
    ├── RequestRefusedError     the master, or a server, answered that it will not do it
    ├── AddressInUseError       another program holds the address
    ├── TooManyFilesError       this process may not open more files
    ├── EncodeError             a payload cannot become bytes
    ├── DecodeError             bytes cannot become a payload
    │   └── WireError               parts that are no message of the native wire
    ├── RecordingError          a recording cannot be written or read
    └── RecordingsUnavailableError  what recordings need is not installed

Beside them `WrongTypeError`, for an argument that is refused at the call.

Every sentence is lower case, without full stop, with values in quotes and the next step after a semicolon.
"""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from nep.i18n import _
from nep.text import escaped, quotable, shortened

__all__ = [
    "AddressInUseError",
    "BackendUnavailableError",
    "BadKeyError",
    "BadNameError",
    "BadTopicError",
    "BadValueError",
    "ClosedError",
    "DecodeError",
    "EncodeError",
    "MasterUnreachable",
    "NepError",
    "NoServerError",
    "NoValueError",
    "ParameterError",
    "PluginsMissingError",
    "RecordingError",
    "RecordingsUnavailableError",
    "RequestRefusedError",
    "ServerGoneError",
    "ServiceError",
    "ServiceTimeoutError",
    "TooManyFilesError",
    "UnknownBackendError",
    "WaitTimeoutError",
    "WireError",
    "WrongTypeError",
    "did_you_mean",
    "nearest",
]

_MAX_WORD_LENGTH = 200
_LONGEST = 500
"""Letters of a reason that somebody else gave."""


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """`did you mean 'zeromq'?` for the nearest known word, else `known are 'a', 'b'`."""
    near = nearest(word, known)
    if near is not None:
        return _("did you mean '{near}'?").format(near=near)
    return _("known are {names}").format(names=", ".join(f"'{name}'" for name in known))


def nearest(word: str, known: Sequence[str]) -> str | None:
    """The known word that is nearly this one."""
    if len(word) > _MAX_WORD_LENGTH:  # comparing takes time with the square of the length
        return None
    return next(iter(get_close_matches(word, known, n=1)), None)


class NepError(Exception):
    """The root of all errors that nep raises on purpose."""


class WaitTimeoutError(NepError):
    """`what` did not happen within `timeout_s` seconds."""

    def __init__(self, what: str, timeout_s: float) -> None:
        self.what: str = what
        self.timeout_s = timeout_s
        super().__init__(_("{what} did not come within {seconds:g} s").format(what=what, seconds=timeout_s))


class ServiceTimeoutError(WaitTimeoutError):
    """The server of `service` did not answer within `timeout_s` seconds; it may still carry the call out."""

    def __init__(self, service: str, timeout_s: float) -> None:
        self.service = service
        super().__init__(_("an answer of '{service}'").format(service=service), timeout_s)


class NoServerError(WaitTimeoutError):
    """No server for `service` within `timeout_s` seconds; `known` are the services that have one.

    `address` is where it was expected, "" when a master tells.
    """

    def __init__(self, service: str, timeout_s: float, known: Sequence[str] = (), address: str = "") -> None:
        self.service = service
        self.address = address
        self.known = tuple(known)
        super().__init__(service, timeout_s)
        near = nearest(service, self.known)
        if address:
            step = _("start it, or check the address '{address}'").format(address=address)
        elif service in self.known:
            step = _(
                "its server can't be reached; programs of the original NEP serve their own computer only"
            )
        elif near is not None:
            step = _("did you mean '{near}'?").format(near=near)
        else:
            step = _("'nep service list' shows all services")
        self.args = (
            _("no server for '{service}' within {seconds:g} s; {step}").format(
                service=service, seconds=timeout_s, step=step
            ),
        )


class ParameterError(NepError, ValueError):
    """The parameter `name` cannot be `value`, as a program writes it ("": none is meant), for `reason`."""

    def __init__(self, name: str, value: str, reason: str) -> None:
        self.name = name
        self.value = value
        self.reason = reason
        super().__init__(
            _("the parameter '{name}' cannot be {value}; {reason}").format(
                name=name, value=value, reason=reason
            )
            if value
            else _("the parameter '{name}': {reason}").format(name=name, reason=reason)
        )


class NoValueError(NepError, KeyError):
    """A blackboard has nothing of `key`, or nothing that is young enough; `known` are keys that it has."""

    def __init__(self, key: str, known: Sequence[str] = ()) -> None:
        self.key = key
        self.known = tuple(known)
        near = nearest(key, self.known)
        step = (
            _("did you mean '{near}'?").format(near=near)
            if near is not None
            else _("'keys' tells what there is")
        )
        super().__init__(
            _("the blackboard has no '{key}'; {step}").format(key=escaped(shortened(key, 200)), step=step)
        )

    def __str__(self) -> str:
        return str(self.args[0])  # and not in quotes, as a `KeyError` has it


class BadKeyError(NepError, ValueError):
    """`key` cannot be the key of a blackboard, for `reason`."""

    def __init__(self, key: str, reason: str) -> None:
        self.key = key
        self.reason = reason
        super().__init__(
            _("'{key}' cannot be a key; {reason}").format(key=escaped(shortened(key, 200)), reason=reason)
        )


class BadValueError(NepError, ValueError):
    """A blackboard cannot keep the value of `key`, for `reason`."""

    def __init__(self, key: str, reason: str) -> None:
        self.key = key
        self.reason = reason
        super().__init__(
            _("'{key}' cannot have this value; {reason}").format(
                key=escaped(shortened(key, 200)), reason=reason
            )
        )


class ServiceError(NepError):
    """The server of `service` raised an error of class `kind`; `reason` is its sentence."""

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
    """The server of `service` ended while a call was under way: nobody knows whether it was carried out."""

    def __init__(self, service: str) -> None:
        self.service = service
        super().__init__(
            _(
                "the server of '{service}' ended while it was called; look whether the call was carried out, "
                "and call again"
            ).format(service=service)
        )


class ClosedError(NepError):
    """The object `what` (such as "subscriber 'example'") was closed before.

    `is_forked`: it belongs to the process that forked this one.
    """

    def __init__(self, what: str, *, is_forked: bool = False) -> None:
        self.what = what
        self.is_forked = is_forked
        if is_forked:
            super().__init__(
                _(
                    "{what} stayed with the program when it was forked, and is closed here; make a new "
                    "node in the child"
                ).format(what=what)
            )
        else:
            super().__init__(_("{what} is closed; make a new one").format(what=what))


class BadTopicError(NepError, ValueError):
    """`topic` breaks the grammar of topic names for `reason`."""

    def __init__(self, topic: str, reason: str) -> None:
        self.topic = topic
        self.reason = reason
        super().__init__(
            _("'{topic}' cannot be a topic; {reason}").format(
                topic=escaped(shortened(topic, 200)), reason=reason
            )
        )


class BadNameError(NepError, ValueError):
    """`name` cannot be the name of a node, for `reason`."""

    def __init__(self, name: str, reason: str) -> None:
        self.name = name
        self.reason = reason
        super().__init__(
            _("'{name}' cannot be a node's name; {reason}").format(
                name=escaped(shortened(name, 200)), reason=reason
            )
        )


class UnknownBackendError(NepError):
    """No back end is called `name`; `known` are the names there are."""

    def __init__(self, name: str, known: Sequence[str]) -> None:
        self.name = name
        self.known = tuple(known)
        super().__init__(
            _("no back end '{name}'; {did_you_mean}").format(
                name=quotable(name), did_you_mean=did_you_mean(name.lower(), self.known)
            )
        )


class BackendUnavailableError(NepError):
    """The back end `name` needs something that is not installed; `needs` says how to get it."""

    def __init__(self, name: str, needs: str) -> None:
        self.name = name
        self.needs = needs
        super().__init__(_("the back end '{name}' is not installed; {needs}").format(name=name, needs=needs))


class PluginsMissingError(NepError):
    """No module of `package` binds `attribute`: the package is empty or was not shipped."""

    def __init__(self, package: str, attribute: str) -> None:
        self.package = package
        self.attribute = attribute
        super().__init__(
            _(
                "no module of '{package}' binds '{attribute}'; name the package to the tool that "
                "froze this program"
            ).format(package=package, attribute=attribute)
        )


class MasterUnreachable(NepError):  # noqa: N818 - the name that the specification of the wire gives it
    """No master answered at `address` within `waited_s` seconds; not `is_known`: nobody knows that name."""

    def __init__(self, address: str, waited_s: float, *, is_known: bool = True) -> None:
        self.address = address
        self.waited_s = waited_s
        self.is_known = is_known
        if not is_known:
            super().__init__(
                _(
                    "no computer is called '{address}' here; look for a typing error, or write its "
                    "address in numbers"
                ).format(address=address.rpartition(":")[0]),
            )
            return
        super().__init__(
            _("no master answers at '{address}' (waited {seconds:g} s); start one with 'nep master'").format(
                address=address, seconds=waited_s
            ),
        )


class RequestRefusedError(NepError):
    """The master, or a server, refused a request; `reason` is its sentence."""

    def __init__(self, reason: str) -> None:
        self.reason = escaped(shortened(reason, _LONGEST))
        super().__init__(self.reason)


class AddressInUseError(NepError):
    """`address` is held by another program, or is not an address of this computer; ":*" is any port of it."""

    def __init__(self, address: str, *, is_own: bool = True) -> None:
        self.address = address
        if not is_own:
            super().__init__(
                _("'{address}' is no address of this computer; use one of its own, or '127.0.0.1'").format(
                    address=address
                )
            )
            return
        if address.endswith(":*"):
            super().__init__(
                _("no port of '{address}' is free; end programs that have many connections").format(
                    address=address[:-2]
                )
            )
            return
        super().__init__(
            _("'{address}' is in use by another program; close it or choose another port").format(
                address=address
            )
        )


class TooManyFilesError(NepError):
    """There is no room for `what`: this process has `opened` of `limit` files open (None: not known)."""

    def __init__(self, what: str, opened: int | None, limit: int | None) -> None:
        self.what = what
        self.opened = opened
        self.limit = limit
        if opened is not None and limit is not None:
            has = _("this program has {opened} of {limit} files open").format(opened=opened, limit=limit)
        else:
            has = _("this program has as many files open as it may")
        step = _("close what it no longer needs, or start it after 'ulimit -n {files}'")
        step = step.format(files=max(8192, 2 * (limit or 0)))
        super().__init__(_("no room for {what}: {has}; {step}").format(what=what, has=has, step=step))


class EncodeError(NepError, ValueError):
    """A payload of Python type `kind` cannot become `codec` bytes, for `reason`.

    `place` is where in the payload, for codecs that know; the reason names it, too.
    """

    def __init__(self, codec: str, kind: str, reason: str, place: str = "") -> None:
        self.codec = codec
        self.kind = kind
        self.place = place
        self.reason = reason
        super().__init__(
            _("cannot encode a '{kind}' as '{codec}'; {reason}").format(kind=kind, codec=codec, reason=reason)
        )


class DecodeError(NepError, ValueError):
    """`size_bytes` bytes are no `codec` payload, for `reason`."""

    def __init__(self, codec: str, size_bytes: int, reason: str) -> None:
        self.codec = codec
        self.size_bytes = size_bytes
        self.reason = reason = escaped(shortened(reason, _LONGEST))  # it may repeat what a stranger wrote
        super().__init__(
            _("cannot decode {size_bytes} bytes as '{codec}'; {reason}").format(
                size_bytes=size_bytes, codec=codec, reason=reason
            )
        )


class WireError(DecodeError):
    """Parts or a request that violate the native wire's specification.

    `code` is independent of language and version: see the table of codes in docs/wire.md.
    """

    def __init__(self, reason: str, size_bytes: int = 0, *, code: str = "malformed") -> None:
        self.code = code
        super().__init__("nep wire", size_bytes, reason)


class RecordingError(NepError):
    """The recording at `path` cannot be used, for `reason`."""

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(
            _("cannot use the recording '{path}'; {reason}").format(path=escaped(path), reason=reason)
        )


class RecordingTooLargeError(RecordingError):
    """Reading the recording at `path` would take more work than is allowed; `reason` says what."""


class RecordingsUnavailableError(NepError):
    """The packages that recordings need are not installed; `needs` says how to get them."""

    def __init__(self, needs: str) -> None:
        self.needs = needs
        super().__init__(_("recordings need what is not installed; {needs}").format(needs=needs))


class WrongTypeError(TypeError, ValueError):
    """An argument of a wrong type: a `ValueError` as every wrong argument, and what Python calls it."""
