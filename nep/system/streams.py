"""The standard streams of a command: every letter can be written, and an output that is gone is no crash.

A pipe of Windows is cp1252 or cp437, one of a bare server ASCII: none of them has all the letters that
programs and people use. A reader may leave (`| head -1`), a disk may be full, a stream may be closed before
the program starts.
"""

from __future__ import annotations

import codecs
import errno
import os
import sys
from contextlib import suppress
from io import RawIOBase, TextIOWrapper

__all__ = ["buffer_output", "close_streams", "output_problem", "prepare_streams", "tell", "words_given"]

_PLAIN = {
    **dict.fromkeys("\u2010\u2011\u2013\u2014\u2212─━·", "-"),  # dashes, minus, lines
    **dict.fromkeys("\u2018\u2019", "'"), **dict.fromkeys("“”„", '"'), **dict.fromkeys("\u00a0\u202f", " "),
    **dict.fromkeys("●•", "*"), "│": "|", "…": "...", "→": "->", "←": "<-", "↔": "<->", "✗": "x", "✓": "+",
    "≤": "<=", "≥": ">=", "\u00d7": "x", "°": " deg",
}  # fmt: skip
_HANDLER = "nep.protocol.encoding"
_GONE = frozenset({errno.EPIPE, errno.ESHUTDOWN, *([errno.EINVAL] if sys.platform == "win32" else [])})
"""What writing into a pipe gives that nobody reads any more; Windows calls it an invalid argument."""
_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF})
"""What writing onto a disk gives that has no room, or is broken, and into a stream that was closed before."""


def prepare_streams() -> None:
    """Let the standard streams take every letter; what their encoding does not have becomes a plainer one.

    The descriptor of a stream that was closed before the program started must not be given to a socket, which
    would then be written to: the null device takes it. Reading and writing what is closed fails, as it does
    for every program; what is only said beside the results goes nowhere.
    """
    codecs.register_error(_HANDLER, _plainer)
    ways = {"stdin": os.O_WRONLY, "stdout": os.O_RDONLY, "stderr": os.O_WRONLY}
    for name, way in ways.items():
        stream = getattr(sys, name)
        if stream is None:
            mode, nowhere = "r" if name == "stdin" else "w", os.open(os.devnull, way)
            setattr(sys, name, open(nowhere, mode, encoding="utf-8"))  # noqa: SIM115, PTH123 - lives on
        elif name != "stdin" and isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)


def buffer_output() -> None:
    """Give the standard output a buffer where it has none (`python -u`, PYTHONUNBUFFERED in a container).

    What cannot be written is there still, then, when `output_problem` asks why. For programs that flush.
    """
    stream = sys.stdout
    if isinstance(stream, TextIOWrapper) and isinstance(stream.buffer, RawIOBase):
        sys.stdout = open(  # noqa: SIM115 - lives on
            stream.fileno(), "w", encoding=stream.encoding, errors=stream.errors, closefd=False
        )


def words_given() -> list[str]:
    """The words of the command line, as UTF-8 also where the system is set to ASCII ("C")."""
    if os.name != "posix":
        return sys.argv[1:]
    escape = "surrogateescape"
    return [word.encode("utf-8", escape).decode("utf-8", escape) for word in sys.argv[1:]]


def _plainer(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = error.object[error.start : error.end]
    return "".join(_PLAIN.get(letter, "?") for letter in letters), error.end


def tell(text: str) -> None:
    """Write a line beside the results, on the error stream; without one that takes it, nothing happens."""
    with suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201 - it is a command's


def output_problem(raised: OSError | None = None) -> str | None:
    """Why the standard output takes nothing more; "" when its reader has left, None when it does take it.

    Asked after an OSError (`raised`): what could not be written is still there, so that writing it fails
    again. Only what is larger than the buffer is dropped, and the error alone tells of it.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        return _words_of(error)
    except ValueError:  # it was closed
        return ""
    if raised is not None and raised.filename is None and raised.errno in _GONE | _FULL:
        return _words_of(raised)
    return None


def _words_of(error: OSError) -> str:
    if error.errno == errno.EBADF:
        return "it is closed"
    return "" if error.errno in _GONE else (error.strerror or str(error)).lower()


def close_streams() -> None:
    """Write what is left, or drop it where that fails: the interpreter would complain at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)
