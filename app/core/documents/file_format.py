"""Format of behaviour files: JSON with name, blocks and robots.

Unknown fields, such as fields of a later version, are preserved.
"""

from __future__ import annotations

import errno
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from app.core.storage import deep_json
from app.core.storage.atomic_file import MAX_BYTES, read_regular_file, write_atomically
from app.errors import DocumentError
from nep.i18n import _, lazy, number

FORMAT = "nep-behaviour"
VERSION = 1
SUFFIX = ".nepb"
TOO_DEEP_MESSAGE = lazy("one stack has more than 4000 blocks")
OPEN_EARLIER_ADVICE = lazy("open an earlier copy")
SPLIT_ADVICE = lazy("split it into several scripts")
DISK_FULL_ERRNOS = frozenset({errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)})
"""Error numbers of a full disk, an exceeded file size limit, and an exceeded quota."""
KNOWN_FIELDS = frozenset({"format", "version", "name", "workspace", "robots"})

Workspace = Mapping[str, object]
Descriptions = Mapping[str, Mapping[str, object]]


@dataclass(frozen=True)
class BehaviourFile:
    """Content of a behaviour file.

    Attributes:
        name: Name of the behaviour.
        workspace: Blocks in Blockly's JSON format.
        robots: Descriptions of the robots in use, by name.
        unknown_fields: Fields that this version doesn't know.
    """

    name: str
    workspace: Workspace
    robots: Descriptions
    unknown_fields: Mapping[str, object] = field(default_factory=dict)


def read_file(path: Path, name: str = "") -> BehaviourFile:
    """Read a behaviour file. Raises DocumentError with advice for the user.

    Args:
        name: Name used in error messages instead of the file name.
    """
    name = name or path.name
    try:
        data = read_regular_file(path)
    except OSError as error:
        message = _("can't read {file} ({reason})")
        raise DocumentError(path, message.format(file=name, reason=error.strerror or error)) from error
    except ValueError as error:  # characters that no file name can have here
        message = _("can't read {file} (file names like this aren't allowed here)")
        raise DocumentError(path, message.format(file=name)) from error
    return parse_file(data, path, name)


def parse_file(data: bytes, path: Path, name: str = "") -> BehaviourFile:
    """Parse the content of a behaviour file.

    Args:
        data: Content of the file.
        path: Path of the file, for error messages and for the name of a behaviour without one.
        name: Name used in error messages instead of the file name.

    Raises:
        DocumentError: The content is damaged, isn't a behaviour, or was saved by a newer Studio.
    """
    name = name or path.name
    try:
        content = deep_json.loads(data)  # UTF-8, or UTF-16 or UTF-32 as some editors on Windows save it
    except (ValueError, RecursionError) as error:
        reason = _("{file} is damaged or not a behaviour").format(file=name)
        raise DocumentError(path, reason, _(OPEN_EARLIER_ADVICE)) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DocumentError(path, _("{file} isn't a behaviour").format(file=name), file_type_hint())
    version = content.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise DocumentError(path, _("{file} has no format version").format(file=name), _(OPEN_EARLIER_ADVICE))
    if version > VERSION:
        template = _("{file} was saved by a newer NEP Studio (version {version}) and is unchanged")
        raise DocumentError(path, template.format(file=name, version=version), _("update NEP Studio"))
    workspace, robots = content.get("workspace"), content.get("robots", {})
    if not isinstance(workspace, dict) or not isinstance(robots, dict):
        raise DocumentError(path, _("{file} has no blocks").format(file=name), _(OPEN_EARLIER_ADVICE))
    descriptions = {
        str(name): description for name, description in robots.items() if isinstance(description, dict)
    }
    unknown_fields = {name: value for name, value in content.items() if name not in KNOWN_FIELDS}
    saved_name = content.get("name")
    return BehaviourFile(
        saved_name if isinstance(saved_name, str) and saved_name else path.stem,
        workspace,
        descriptions,
        unknown_fields,
    )


def encode_file(behaviour: BehaviourFile) -> bytes:
    """Return a behaviour in the file format.

    Raises RecursionError if a stack has more than about 4000 blocks.
    """
    content = {
        "format": FORMAT,
        "version": VERSION,
        "name": behaviour.name,
        "workspace": behaviour.workspace,
        "robots": behaviour.robots,
        **behaviour.unknown_fields,
    }
    return deep_json.dumps(content, indent=1).encode("utf-8", "surrogatepass")


def write_file(path: Path, behaviour: BehaviourFile) -> None:
    """Write a behaviour file atomically.

    Raises DocumentError with advice for the user; the existing file is then unchanged.
    """
    try:
        data = encode_file(behaviour)
        if len(data) > MAX_BYTES:
            size, limit_mb = len(data) / 1e6, MAX_BYTES / 1e6
            template = _("{file} would be {size} MB").format(file=path.name, size=number(size, ".1f"))
            advice = _("the limit is {most} MB; use smaller images").format(most=number(limit_mb, ".0f"))
            raise DocumentError(path, template, advice)
        write_atomically(path, data)
    except RecursionError as error:
        message = _("can't write {file}: {reason}").format(file=path.name, reason=_(TOO_DEEP_MESSAGE))
        raise DocumentError(path, message, _(SPLIT_ADVICE)) from error
    except OSError as error:
        reason = error.strerror or str(error)
        message = _("can't write {file} ({reason})").format(file=path.name, reason=reason)
        advice = (
            _("free some space or choose another folder")
            if error.errno in DISK_FULL_ERRNOS
            else _("save it in another folder")
        )
        raise DocumentError(path, message, advice) from error


def file_type_hint() -> str:
    """Return a hint about the file extension of behaviours, for error messages about other files."""
    return _("the file name of a behaviour ends in {suffix}").format(suffix=SUFFIX)
