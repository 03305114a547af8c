"""Format of behaviour files: JSON with name, blocks and robots.

A project with more than the page "always" has format version 2, which adds ``pages``. Unknown
fields, such as fields of a later version, are preserved.
"""

from __future__ import annotations

import errno
import re
from collections.abc import Mapping
from pathlib import Path

from app.blocks.model import deep_json
from app.blocks.model.project import ALWAYS_ID, PAGE_KINDS, Page, Project, always_page
from app.blocks.model.workspace_json import WorkspaceJson
from app.core.storage.atomic_file import MAX_BYTES, read_regular_file, write_atomically
from app.errors import DocumentError
from nep.i18n import _, lazy, number

FORMAT = "nep-behaviour"
SINGLE_PAGE_VERSION, VERSION = 1, 2
SUFFIX = ".nepb"
TOO_DEEP_MESSAGE = lazy("one stack has more than 4000 blocks")
OPEN_EARLIER_ADVICE = lazy("open an earlier copy")
SPLIT_ADVICE = lazy("split it into several scripts")
DISK_FULL_ERRNOS = frozenset({errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)})
"""Error numbers of a full disk, an exceeded file size limit, and an exceeded quota."""
_FIELDS = frozenset({"format", "version", "name", "workspace", "robots"})
KNOWN_FIELDS = {SINGLE_PAGE_VERSION: _FIELDS, VERSION: _FIELDS | {"pages"}}
"""Fields of each format version."""
_PAGE_ID = re.compile(r"[a-z0-9-]{1,40}")


def read_file(path: Path, name: str = "") -> Project:
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


def parse_file(data: bytes, path: Path, name: str = "") -> Project:
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
    saved_name = content.get("name")
    try:
        return parse_project(
            content,
            saved_name if isinstance(saved_name, str) and saved_name else path.stem,
            {name: value for name, value in content.items() if name not in KNOWN_FIELDS[version]},
            is_single_page=version == SINGLE_PAGE_VERSION,
        )
    except ValueError as error:
        reason = _("{file} is damaged or not a behaviour").format(file=name)
        raise DocumentError(path, reason, _(OPEN_EARLIER_ADVICE)) from error


def parse_project(
    saved: Mapping[str, object],
    name: str,
    unknown_fields: Mapping[str, object],
    *,
    is_single_page: bool,
) -> Project:
    """Parse the pages of a file or journal, whose ``workspace`` and ``robots`` are JSON objects.

    Args:
        saved: Content of the file or journal.
        name: Name of the project.
        unknown_fields: Fields of the file that this version doesn't know.
        is_single_page: True to ignore the fields of later format versions.

    Raises:
        ValueError: The pages are invalid.
    """
    pages = [] if is_single_page else saved.get("pages", [])
    if not isinstance(pages, list):
        raise ValueError("pages are not a list")  # noqa: TRY004 (data of a file)
    robots = _parse_object(saved.get("robots", {}))
    return Project(
        name,
        (_always_page(saved), *map(_parse_page, pages)),
        {name: description for name, description in robots.items() if isinstance(description, dict)},
        unknown_fields,
    )


def _parse_object(saved: object) -> dict[str, object]:
    if not isinstance(saved, dict):
        raise ValueError("not a JSON object")  # noqa: TRY004 (data of a file)
    return saved


def _always_page(saved: Mapping[str, object]) -> Page:
    return always_page(WorkspaceJson.from_blocks(_parse_object(saved.get("workspace"))))


def _parse_page(saved: object) -> Page:
    page = _parse_object(saved)
    id, name, kind = page.get("id"), page.get("name"), page.get("kind")
    if not isinstance(id, str) or not _PAGE_ID.fullmatch(id) or id == ALWAYS_ID:
        raise ValueError("invalid id of a page")
    if not isinstance(name, str) or kind not in PAGE_KINDS:
        raise ValueError("invalid name or kind of a page")
    return Page(id, name, kind, WorkspaceJson.from_blocks(_parse_object(page.get("workspace"))))


def format_version(project: Project) -> int:
    """Return the lowest format version that can contain a project."""
    return SINGLE_PAGE_VERSION if project.is_single_page else VERSION


def page_fields(page: Page) -> dict[str, object]:
    """Return a page as a JSON object, without its workspace."""
    return {"id": page.id, "name": page.name, "kind": page.kind}


def encode_file(project: Project) -> bytes:
    """Return a project in the file format.

    Raises RecursionError if a stack has more than about 4000 blocks.
    """
    content: dict[str, object] = {
        "format": FORMAT,
        "version": format_version(project),
        "name": project.name,
        "workspace": project.always.workspace.blocks,
        "robots": project.robots,
    }
    if not project.is_single_page:
        content["pages"] = [
            {**page_fields(page), "workspace": page.workspace.blocks} for page in project.pages[1:]
        ]
    content |= {name: value for name, value in project.unknown_fields.items() if name not in content}
    return deep_json.dumps(content, indent=1).encode("utf-8", "surrogatepass")


def write_file(path: Path, project: Project) -> None:
    """Write a behaviour file atomically.

    Raises DocumentError with advice for the user; the existing file is then unchanged.
    """
    try:
        data = encode_file(project)
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
