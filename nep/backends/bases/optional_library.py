"""Third-party libraries of back ends, which are loaded with the first node and can't be used after a fork."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from nep.errors import BackendUnavailableError, NepError
from nep.i18n import _

T = TypeVar("T")


class OptionalLibrary:
    """Library of a back end.

    Args:
        backend: Name of the back end.
        install_hint: Returns the sentence that says how to install the library.
    """

    def __init__(self, backend: str, install_hint: Callable[[], str]) -> None:
        self._backend = backend
        self._install_hint = install_hint
        self.has_forked = False
        """True in a process forked from one that uses the library, whose threads don't exist there."""

    def load(self, import_modules: Callable[[], T]) -> T:
        """Return the result of `import_modules`.

        Raises:
            BackendUnavailableError: The library is not installed or can't be loaded.
            NepError: The process was forked from one that uses the library.
        """
        if self.has_forked:
            raise NepError(
                _(
                    "'{backend}' doesn't work in a process forked from a program that uses it; start the "
                    "process with multiprocessing's start method 'spawn'"
                ).format(backend=self._backend)
            )
        try:
            return import_modules()
        except Exception as error:  # some loaders raise exceptions of their own classes
            raise BackendUnavailableError(self._backend, self._install_hint()) from error
