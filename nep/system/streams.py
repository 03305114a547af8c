"""Standard streams of a command: encode every character, and handle a closed output.

A pipe uses cp1252 or cp437 on Windows and ASCII on a minimal server, which lack many characters. The reader
of a pipe may exit (`| head -1`), a disk may be full, and a stream may be closed before the program starts.
"""

from __future__ import annotations

import codecs
import errno
import os
import sys
from contextlib import suppress
from io import RawIOBase, TextIOWrapper

from nep.i18n import _

_REPLACEMENTS = {
    **dict.fromkeys("\u2010\u2011\u2013\u2014\u2212─━·", "-"),  # dashes, minus, lines
    **dict.fromkeys("\u2018\u2019", "'"), **dict.fromkeys("“”„", '"'), **dict.fromkeys("\u00a0\u202f", " "),
    **dict.fromkeys("●•", "*"), "│": "|", "…": "...", "→": "->", "←": "<-", "↔": "<->", "✗": "x", "✓": "+",
    "≤": "<=", "≥": ">=", "\u00d7": "x", "°": " deg",
}  # fmt: skip
_ERROR_HANDLER = "nep.replace_unencodable"
_READER_GONE_ERRNOS = frozenset(
    {errno.EPIPE, errno.ESHUTDOWN, *([errno.EINVAL] if sys.platform == "win32" else [])}
)
"""errno values for writing to a pipe whose reader has exited; Windows reports an invalid argument."""
_DISK_ERRNOS = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF})
"""errno values for writing to a full or failing disk, or to a stream that was closed before the start."""


def prepare_streams() -> None:
    """Make the standard streams replace characters that their encoding lacks with similar ones.

    Streams that were closed before the program started are opened to the null device, so that sockets don't
    get their descriptors. Reading or writing them fails as usual; messages to a closed stderr are discarded.
    """
    codecs.register_error(_ERROR_HANDLER, _replace_unencodable)
    open_flags = {"stdin": os.O_WRONLY, "stdout": os.O_RDONLY, "stderr": os.O_WRONLY}
    for name, flags in open_flags.items():
        stream = getattr(sys, name)
        if stream is None:
            mode, null_descriptor = "r" if name == "stdin" else "w", os.open(os.devnull, flags)
            setattr(sys, name, open(null_descriptor, mode, encoding="utf-8"))  # noqa: SIM115, PTH123 - stays open
        elif name != "stdin" and isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors=_ERROR_HANDLER)


def buffer_output() -> None:
    """Add a buffer to an unbuffered standard output (`python -u`, or PYTHONUNBUFFERED in a container).

    With a buffer, `output_problem` can detect failed writes by flushing. A program that calls this
    function must flush its output.
    """
    stream = sys.stdout
    if isinstance(stream, TextIOWrapper) and isinstance(stream.buffer, RawIOBase):
        sys.stdout = open(  # noqa: SIM115 - stays open
            stream.fileno(), "w", encoding=stream.encoding, errors=stream.errors, closefd=False
        )


def command_line_arguments() -> list[str]:
    """Return the command-line arguments, decoded as UTF-8 even in the locale "C"."""
    if os.name != "posix":
        return sys.argv[1:]
    escape = "surrogateescape"
    return [argument.encode("utf-8", escape).decode("utf-8", escape) for argument in sys.argv[1:]]


def _replace_unencodable(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    characters = error.object[error.start : error.end]
    return "".join(_REPLACEMENTS.get(character, "?") for character in characters), error.end


def print_error(text: str) -> None:
    """Write a line to stderr, ignoring write errors."""
    with suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201 - output of a command


def output_problem(write_error: OSError | None = None) -> str | None:
    """Return the reason why stdout can't be written, or None if stdout works.

    The reason is "" if the reader of stdout has exited or stdout is closed.

    Unwritten text stays in the buffer, so a failed write is detected by flushing again. Text larger
    than the buffer is lost; pass the exception of that write as `write_error`, because it is the only
    evidence.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        return _write_error_reason(error)
    except ValueError:  # closed
        return ""
    if (
        write_error is not None
        and write_error.filename is None
        and write_error.errno in _READER_GONE_ERRNOS | _DISK_ERRNOS
    ):
        return _write_error_reason(write_error)
    return None


def _write_error_reason(error: OSError) -> str:
    if error.errno == errno.EBADF:
        return _("it is closed")
    return "" if error.errno in _READER_GONE_ERRNOS else (error.strerror or str(error)).lower()


def flush_streams() -> None:
    """Flush the standard streams. Text that can't be written is discarded; it would fail again at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                null_descriptor = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null_descriptor, stream.fileno())
                os.close(null_descriptor)
