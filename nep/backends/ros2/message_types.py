"""ROS 2 message types: definitions, and conversion between maps and CDR by rosbags.

rosbags includes the common packages of each ROS 2 release. `MessageTypes.add` adds a type from the text
of a .msg file, `MessageTypes.add_folder` adds a folder of .msg files.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nep.backends.ros2.environment import distribution
from nep.backends.ros2.library import load_typesys
from nep.backends.ros2.names import type_name
from nep.backends.ros_types.rosbags_fields import (
    PLACEHOLDER_FIELD,
    RosField,
    convert_definition,
    from_message,
    to_message,
)
from nep.errors import DecodeError, EncodeError, NepError, did_you_mean
from nep.i18n import _
from nep.messages.fields import FieldPathError

FOLDERS_VARIABLE = "NEP_ROS_MSG_PATH"
"""Name of the environment variable that lists folders of .msg files."""
_MAX_FILE_BYTES = 2**20
_MAX_FILES = 10_000
_WIDE_STRING_TYPE = "wstring"
_GID_TYPE = "rmw_dds_common/msg/Gid"


class MessageTypes:
    """Message types of one ROS 2 release. Thread-safe."""

    def __init__(self, release: str) -> None:
        rosbags = load_typesys()
        try:
            store = rosbags.Stores[f"ROS2_{release.upper()}"]
        except KeyError:
            releases = [each.name.removeprefix("ROS2_").lower() for each in rosbags.Stores]
            raise NepError(
                _("ROS_DISTRO is '{release}', which rosbags doesn't know; {did_you_mean}").format(
                    release=release[:40], did_you_mean=did_you_mean(release, releases)
                )
            ) from None
        self._rosbags = rosbags
        self._store: Any = rosbags.get_typestore(store)
        self._fields: dict[str, tuple[RosField, ...]] = {}
        self._type_errors: dict[str, NepError] = {}
        self._lock = threading.RLock()
        self._read_definitions()

    def _read_definitions(self) -> None:
        # `char` is replaced by `uint8`, which type hashes are computed from.
        for name, (constants, entries) in list(self._store.fielddefs.items()):
            if name not in self._fields:
                converted, fields = convert_definition(entries)
                self._store.fielddefs[name] = (constants, converted)
                self._fields[name] = fields

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all known types, such as "std_msgs/msg/String"."""
        return tuple(sorted(name for name in self._fields if "/msg/" in name))

    @property
    def gid_bytes(self) -> int:
        """Length in bytes of a GUID in this release's `ros_discovery_info`."""
        return self._fields[_GID_TYPE][0].size if _GID_TYPE in self._fields else 24

    def validate(self, msg_type: str) -> str:
        """Validate a message type and return its full name. Raises `NepError` if the type is unknown."""
        name = type_name(msg_type)
        if name in self._type_errors and name not in self._fields:
            raise self._type_errors[name]
        if name not in self._fields:
            raise NepError(
                _(
                    "unknown message type '{name}'; {did_you_mean} (or set {variable} to a folder of "
                    ".msg files)"
                ).format(name=name, did_you_mean=_suggestion(name, self.names), variable=FOLDERS_VARIABLE)
            )
        return name

    def fields(self, name: str) -> tuple[RosField, ...]:
        """Return the fields of a type."""
        return self._fields[name]

    def type_hash(self, name: str) -> str:
        """Return the type hash (`RIHS01_…`), which ROS 2 announces since Iron."""
        with self._lock:
            return str(self._store.hash_rihs01(name))

    def encode(self, name: str, payload: object) -> bytes:
        """Encode a map as CDR; missing fields are zero, empty or False. Raises `EncodeError`."""
        kind = type(payload).__name__
        try:
            message = to_message(self, name, payload)
            with self._lock:
                return bytes(self._store.serialize_cdr(message, name))
        except FieldPathError as error:
            reason = f"'{error.path}' {error.reason}" if error.path else error.reason
            raise EncodeError(name, kind, reason, place=error.path or ".") from error
        except Exception as error:  # rosbags has no codec for some types, such as those with wide strings
            raise EncodeError(name, kind, str(error) or type(error).__name__) from error

    def decode(self, name: str, data: bytes | memoryview) -> object:
        """Decode CDR to a map. Arrays of `uint8` become `bytes`, other arrays lists. Raises `DecodeError`."""
        try:
            with self._lock:
                message = self._store.deserialize_cdr(data, name)
        except Exception as error:  # the data is untrusted
            raise DecodeError(name, len(data), str(error) or type(error).__name__) from error
        return from_message(self, name, message)

    def message_class(self, name: str) -> Any:  # noqa: ANN401 - created by rosbags
        """Return the message class that rosbags creates for a type."""
        return self._store.types[name]

    def add(self, name: str, text: str) -> None:
        """Add a type such as "my_robot/msg/Arm" from the text of its .msg file.

        Raises `NepError` if the text is invalid, uses unknown types, or differs from a known type with the
        same name.
        """
        for error in self._add({type_name(name): text}).values():
            raise error

    def add_service_part(self, name: str, text: str) -> None:
        """Add the request or response type of a service, such as "std_srvs/srv/SetBool_Request".

        Raises the same errors as `add`.
        """
        package, _srv, last = name.split("/")
        message_name = f"{package}/msg/{last}"  # lets rosbags resolve the package's own messages
        try:
            parsed = self._rosbags.get_types_from_msg(text, message_name)[message_name]
        except Exception as error:  # its parser raises its own exception classes
            raise NepError(
                _("the definition of '{name}' can't be read: {error}").format(name=name, error=error)
            ) from error
        with self._lock:
            fields = convert_definition(parsed[1])[1]
            for missing_error in self._missing_type_errors({name: fields}).values():
                raise missing_error
            existing = [each for each in self._fields.get(name, fields) if each.name != PLACEHOLDER_FIELD]
            if existing != [each for each in fields if each.name != PLACEHOLDER_FIELD]:
                raise NepError(
                    _(
                        "'{name}' is already defined with other fields; choose another name, or restart "
                        "the program"
                    ).format(name=name)
                )
            if name not in self._fields:
                self._store.register({name: parsed})
                self._read_definitions()

    def add_folder(self, folder: Path) -> None:
        """Add all .msg files of a folder, such as `my_robot/msg/Arm.msg`.

        The package of a file outside a `msg` folder is the name of its folder. An error in a file is
        reported when its type is used. Raises `NepError` if no file is valid, there are too many files,
        a file is too large, or a known type has other fields.
        """
        texts: dict[str, str] = {}
        for path in sorted(folder.rglob("*.msg")):
            package = path.parent.parent.name if path.parent.name == "msg" else path.parent.name
            if len(texts) >= _MAX_FILES or path.stat().st_size > _MAX_FILE_BYTES:
                raise NepError(
                    _(
                        "'{path}' is too large, or there are too many files; choose a folder with .msg "
                        "files only"
                    ).format(path=path)
                )
            texts[type_name(f"{package}/msg/{path.stem}")] = path.read_text(encoding="utf-8")
        if not texts:
            raise NepError(_("no .msg files in '{folder}'; choose another folder").format(folder=folder))
        errors = self._add(texts)
        if len(errors) == len(texts):
            raise next(iter(errors.values()))
        self._type_errors.update(errors)

    def _add(self, texts: Mapping[str, str]) -> dict[str, NepError]:
        # Returns the errors of invalid types. Raises `NepError` if a known type has changed.
        parsed: dict[str, Any] = {}
        errors: dict[str, NepError] = {}
        for name, text in texts.items():
            try:
                parsed.update(self._rosbags.get_types_from_msg(text, name))
            except Exception as error:  # noqa: BLE001 - its parser raises its own exception classes
                errors[name] = NepError(
                    _("the definition of '{name}' can't be read: {error}").format(name=name, error=error)
                )
        with self._lock:
            fields = {name: convert_definition(entries)[1] for name, (_constants, entries) in parsed.items()}
            while missing_type_errors := self._missing_type_errors(fields):
                errors.update(missing_type_errors)
                fields = {name: each for name, each in fields.items() if name not in missing_type_errors}
            unchanged = {
                name for name in fields if name in self._fields and self._fields[name] == fields[name]
            }
            changed = sorted(name for name in fields if name in self._fields and name not in unchanged)
            if changed:
                raise NepError(
                    _(
                        "'{name}' is already defined with other fields; choose another name, or restart "
                        "the program"
                    ).format(name=changed[0])
                )
            self._store.register({name: parsed[name] for name in fields if name not in unchanged})
            self._read_definitions()
        return errors

    def _missing_type_errors(self, fields: Mapping[str, Sequence[RosField]]) -> dict[str, NepError]:
        # Returns the errors of types that use unknown types.
        wstring_message = _(
            "'{name}' has the field '{field}' of type wstring, which 'ros2' doesn't support; use a string"
        )
        unknown_message = _(
            "'{name}' has the field '{field}' of type '{kind}', which is unknown or not supported; add "
            "that type, too"
        )
        return {
            name: NepError(
                (wstring_message if field.kind.endswith(f"/{_WIDE_STRING_TYPE}") else unknown_message).format(
                    name=name, field=field.name, kind=field.kind
                )
            )
            for name, each in fields.items()
            for field in each
            if field.is_message and field.kind not in fields and field.kind not in self._fields
        }


def _suggestion(name: str, candidates: tuple[str, ...]) -> str:
    ending = name.rpartition("/")[2].lower()
    similar_names = [each for each in candidates if each.rpartition("/")[2].lower() == ending]
    return (
        did_you_mean(name, tuple(similar_names) or candidates)
        if similar_names or len(candidates) < 10
        else _short_suggestion(name, candidates)
    )


def _short_suggestion(name: str, candidates: tuple[str, ...]) -> str:
    suggestion = did_you_mean(name, candidates)
    return suggestion if len(suggestion) < 200 else _("see 'nep.backends.ros2.message_types().names'")


_types: dict[str, MessageTypes] = {}
_types_lock = threading.Lock()


def message_types() -> MessageTypes:
    """Return the message types of the release in $ROS_DISTRO and of the folders in $NEP_ROS_MSG_PATH.

    Raises `BackendUnavailableError`, and `NepError` if a folder has no valid file.
    """
    release = distribution(os.environ)
    with _types_lock:
        if release not in _types:
            types = MessageTypes(release)
            for folder in os.environ.get(FOLDERS_VARIABLE, "").split(os.pathsep):
                if folder:
                    types.add_folder(Path(folder))
            _types[release] = types
        return _types[release]
