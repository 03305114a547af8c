"""Entry points of NEP Studio: the window, a behaviour without a window, the self-test, and child processes.

``python -m app [FILE ...]`` opens the window; ``python -m app run FILE`` runs a behaviour without it;
``python -m app --selftest DIR`` tests this installation. A frozen build also starts its child processes from
the same executable: ``--child`` runs a program, ``--module NAME`` runs one of `CHILD_MODULES`.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import logging
import os
import runpy
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from nep.errors import NepError
from nep.i18n import _, set_initial_language
from nep.system.addresses import MASTER_VARIABLE, master_address
from nep.system.descriptors import raise_open_file_limit
from nep.system.streams import command_line_arguments, flush_streams, prepare_streams, print_error
from nep.version import __version__

CHILD_MODULES = (
    "app.blocks.runtime.child",
    "app.core.graph.layout_process",
    "app.robots.simulated",
    "app.robots.turtle",
    "app.ui.speaker",
    "nep",
    "nep.recordings.child",
    "nep.recordings.apart.reader_process",
)

JOIN_TIMEOUT_S = 5.0
"""Time in seconds that non-daemon threads have to end after the window is closed."""

_log = logging.getLogger("studio")


def window_parser() -> argparse.ArgumentParser:
    """Return the argument parser of ``python -m app``."""
    parser = argparse.ArgumentParser(
        prog="nep-studio",
        description=_("NEP Studio. `nep-studio run FILE` runs a behaviour without a window."),
    )
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help=_("behaviours to open"))
    parser.add_argument(
        "--new-window",
        action="store_true",
        help=_("open a separate window even if Studio is already running"),
    )
    parser.add_argument(
        "--demo", action="store_true", help=_("start with the virtual robot and the first example")
    )
    parser.add_argument("--master", metavar="HOST:PORT", help=_("address of the master"))
    parser.add_argument("--version", action="version", version=f"NEP Studio {__version__}")
    parser.add_argument("--theme", choices=("light", "dark", "system"), help=_("colour theme"))
    parser.add_argument(
        "--self-drive",
        metavar="DIR",
        type=Path,
        help=_("perform the main task unattended; save screenshots to DIR"),
    )
    parser.add_argument(
        "--selftest",
        metavar="DIR",
        type=Path,
        help=_("test all parts of Studio; write a report to DIR"),
    )
    parser.add_argument(
        "--no-web", dest="web", action="store_false", help=_("with --selftest: skip the block editor")
    )
    return parser


def run_parser() -> argparse.ArgumentParser:
    """Return the argument parser of ``python -m app run``."""
    parser = argparse.ArgumentParser(
        prog="nep-studio run",
        description=_(
            "Run a behaviour without a window. Exit codes: 0 finished; 1 a block failed or a robot "
            "didn't stop; 2 the file can't be run; 3 one of its robots is missing; 4 a real robot "
            "would move and isn't allowed to; 130 stopped by Ctrl+C."
        ),
    )
    parser.add_argument("file", type=Path, metavar="FILE", help=_("the behaviour"))
    parser.add_argument(
        "--robot-wait",
        type=float,
        metavar="S",
        default=10.0,
        help=_("seconds to wait for the behaviour's robots"),
    )
    parser.add_argument("--master", metavar="HOST:PORT", help=_("address of the master"))
    parser.add_argument(
        "--allow-moving",
        action="store_true",
        help=_("allow real robots to move; Ctrl+C stops them"),
    )
    parser.add_argument(
        "--keep-position",
        action="store_true",
        help=_("keep the current positions of the virtual robots instead of resetting them to the start"),
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run Studio and return its exit code; 2 if a required package is missing.

    Args:
        arguments: Command-line arguments (default: those of the process).
    """
    prepare_streams()
    try:
        return _main(command_line_arguments() if arguments is None else list(arguments))
    except ImportError as error:
        from app.core.reports.not_installed import import_problem  # noqa: PLC0415  needed only here

        message = import_problem(error)
        if not message:
            raise
        print_error(f"nep-studio: {message}")
        return 2
    finally:
        flush_streams()


def _main(arguments: Sequence[str]) -> int:
    if arguments[:1] == ["--child"]:
        return run_child_module("app.blocks.runtime.child", arguments[1:])
    if arguments[:1] == ["--module"] and len(arguments) > 1:
        return run_child_module(arguments[1], arguments[2:])
    # not needed by child processes of a frozen build
    from app.core.storage.settings import Settings  # noqa: PLC0415
    from app.core.storage.settings_file import read_setting  # noqa: PLC0415

    # a self-test leaves the user's settings unchanged
    is_self_test = any(argument.startswith("--selft") for argument in arguments)
    set_initial_language("" if is_self_test else read_setting(Settings.language))
    if arguments[:1] == ["run"]:
        return run_behaviour(arguments[1:])
    parser = window_parser()
    options = parser.parse_intermixed_args(arguments)
    if options.master is not None:
        try:  # for the window and the processes that it starts
            os.environ[MASTER_VARIABLE] = master_address(options.master)
        except NepError as error:
            parser.error(str(error))
    if options.selftest is not None:
        return self_test(options.selftest, web=options.web)
    if not options.web:
        parser.error(_("--no-web requires --selftest"))
    # saves a tenth of the start time; the window runs the collector itself (`app.ui.startup.interpreter`)
    gc.disable()
    # Shiboken reads the source of every module imported after Qt, so modules without Qt are imported first.
    importlib.import_module("app.core.session")
    raise_open_file_limit()
    from app.ui.application import RESTART_EXIT_CODE, Options, run  # noqa: PLC0415  Qt is loaded only for a window

    code = run(
        Options(tuple(options.files), options.demo, options.theme, options.self_drive, options.new_window)
    )
    if code == RESTART_EXIT_CODE:
        restart(options.theme)
        code = 0
    return end_process(code)


def restart(theme: str | None) -> None:
    """Start Studio in a new process, after all resources of this process were closed.

    Args:
        theme: Value of the option ``--theme``; None for the theme in the settings.
    """
    from app.core.reports.own_process import fresh_environ, studio_command  # noqa: PLC0415  needed only here
    from nep.masters.process import NO_CONSOLE  # noqa: PLC0415  needed only here

    subprocess.Popen(
        studio_command(theme),
        stdin=subprocess.DEVNULL,
        env=fresh_environ(os.environ),
        creationflags=NO_CONSOLE,
    )


def self_test(folder: Path, *, web: bool) -> int:
    """Run the self-test in a real window, write its report and end the process.

    Args:
        folder: Folder for the report.
        web: False to skip the block editor.

    Returns:
        2 if `folder` can't be written. Otherwise the process ends with exit code 0 if all steps passed, or 1
        if a step failed (see the report).
    """
    from app.core.self_test import SelfTest, UnwritableFolderError, prepare  # noqa: PLC0415  needed only here

    try:
        is_root = hasattr(os, "geteuid") and os.geteuid() == 0
        test = SelfTest(prepare(folder, os.environ, is_root=is_root), {"web": web})
    except UnwritableFolderError as error:
        print_error(f"nep-studio: {error}")
        return 2

    def run_steps() -> int:
        test.start_step("program", _("the program was loaded"))
        importlib.import_module("app.core.session")
        raise_open_file_limit()
        from app.ui.self_test import run_window_steps  # noqa: PLC0415  import errors go into the report

        return run_window_steps(test, loads_web_view=web)

    gc.disable()  # as at every start of the window
    code = test.run(run_steps)
    outcome = test.report.failure or _("the self-test passed")
    with suppress(OSError, ValueError):  # the output stream may be closed; the report is the result
        (sys.stderr if code else sys.stdout).write(f"{outcome}: {test.environment.folder}\n")
    # The exit code is the result, which a crash of Qt at the end of the process would replace.
    return end_process(code, is_immediate=True)


def run_behaviour(arguments: Sequence[str]) -> int:
    """Run a behaviour file without a window and return the exit code (see `app.run`)."""
    options = run_parser().parse_args(arguments)
    from app.run import run_file  # noqa: PLC0415  not needed by child processes

    return run_file(
        options.file,
        robot_wait_s=options.robot_wait,
        master=options.master,
        allow_moving=options.allow_moving,
        keep_position=options.keep_position,
    )


def run_child_module(module: str, arguments: Sequence[str]) -> int:
    """Run a module as ``__main__`` in this process and return the exit code.

    If the module calls `sys.exit`, the SystemExit is passed on.

    Args:
        module: One of `CHILD_MODULES`; for any other module, the exit code is 2.
        arguments: Command-line arguments of the module.
    """
    if module not in CHILD_MODULES:
        sys.stderr.write(
            _("no process '{module}'; available: {names}").format(
                module=module, names=", ".join(CHILD_MODULES)
            )
            + "\n"
        )
        return 2
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    return 0


def join_threads(within_s: float) -> tuple[str, ...]:
    """Wait for all other non-daemon threads, and return the names of those that are still running.

    Args:
        within_s: Maximum wait in seconds, for all threads together.
    """
    deadline_s = time.monotonic() + within_s
    other_threads = [
        thread
        for thread in threading.enumerate()
        if not thread.daemon
        and thread is not threading.current_thread()
        and thread is not threading.main_thread()
    ]
    for thread in other_threads:
        thread.join(max(0.0, deadline_s - time.monotonic()))
    return tuple(thread.name for thread in other_threads if thread.is_alive())


def end_process(code: int, within_s: float = JOIN_TIMEOUT_S, *, is_immediate: bool = False) -> int:
    """Wait for all non-daemon threads and return ``code``; if some don't end, log them and exit at once.

    Python waits for every non-daemon thread at exit. A plug-in's thread that never ends, or a thread that
    writes to a disk that doesn't respond, would keep a process without a window alive forever.

    Args:
        code: Exit code of the process.
        within_s: Maximum wait in seconds.
        is_immediate: True to exit in any case, without the cleanup of Python and Qt.
    """
    running_threads = join_threads(within_s)
    if not running_threads and not is_immediate:
        return code
    if running_threads:
        names = ", ".join(f"'{name}'" for name in running_threads)
        _log.error("exiting while threads are still running: %s", names)
    logging.shutdown()
    flush_streams()
    os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
