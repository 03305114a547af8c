"""Process of a driver: command line, waiting for a master, and exit together with an owner process."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType, TracebackType

import psutil

import nep
from app.errors import AppError, DescriptionError
from app.robots.description.description import topic_of
from app.robots.driver.call import Failed
from app.robots.driver.declare import Kind
from app.robots.driver.driver import Driver
from nep.i18n import _
from nep.system.addresses import master_address
from nep.system.crash_trace import enable_crash_trace
from nep.system.terminal import Terminal, log_to
from nep.text import escaped

_OWNER_CHECK_INTERVAL_S = 0.5


def main(kind: Kind, arguments: Sequence[str] | None = None) -> int:
    """Run a robot of this kind until SIGTERM, Ctrl+C or the exit of the owner.

    Prints the robot's model, topics and master. Waits until the master replies.

    Args:
        kind: Kind of the robot.
        arguments: Command-line arguments (default: those of the process).

    Returns:
        Exit code: 0 after a normal end; 1 if the robot can't be connected (its class raised Failed),
        its description is invalid, or its node can't be opened, such as for an invalid name.
    """
    parser = argparse.ArgumentParser(
        description=_("Run the driver of a robot: {title}.").format(title=kind.title)
    )
    parser.add_argument("--name", default=kind.title, help=_("robot name, used as the prefix of its topics"))
    parser.add_argument("--master", default=None, help=_("master address (default: $NEP_MASTER)"))
    parser.add_argument("--owner-pid", type=int, default=None, help=_("exit when this process has ended"))
    options = parser.parse_args(arguments)
    ended = threading.Event()
    enable_crash_trace()
    _handle_signals(ended)
    with Terminal(sys.stderr) as terminal:  # a blocked stderr must not block the robot's threads
        log_to(terminal, logging.INFO)
        try:
            run(kind, options.name, ended, master=options.master, owner_pid=options.owner_pid)
        except (Failed, AppError, nep.NepError) as error:  # Failed: raised by the robot's __init__
            _print(f"{options.name}: {error}", terminal)
            return 1
    return 0


def install_exception_hook() -> None:
    """Install a `sys.excepthook` that prints an invalid description as one sentence without a traceback.

    Descriptions are generated while Python executes the class, before the driver can catch an exception.
    """
    previous_hook = sys.excepthook

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if isinstance(error, DescriptionError):
            with Terminal(sys.stderr) as terminal:
                _print(str(error), terminal)
        else:
            previous_hook(kind, error, trace)

    sys.excepthook = hook


def run(
    kind: Kind, name: str, ended: threading.Event, *, master: str | None = None, owner_pid: int | None = None
) -> None:
    """Run the driver of a robot until an event is set or the owner exits; then stop the robot.

    Progress is printed only without an owner. An owner monitors the robot over the network, and treats
    printed lines as the reason for an exit.

    Args:
        kind: Kind of the robot.
        name: Name of the robot.
        ended: Event that ends the driver.
        master: Address of the master; default as for `nep.node`.
        owner_pid: Process id of the owner; None for no owner. If the owner has already exited, nothing
            is run.
    """
    owner = _owner_process(owner_pid)
    if owner_pid is not None and owner is None:
        return
    with Terminal(sys.stdout) as output, nep.node(name, master=master) as node, _forward_log(node):
        driver = Driver(kind, name, node)

        def print_progress(text: str) -> None:
            if owner is None:
                _print(text, output)

        message = (
            _("{robot}: virtual robot, model {model}; topics: {topics}")
            if kind.virtual
            else _("{robot}: robot, model {model}; topics: {topics}")
        )
        print_progress(message.format(robot=name, model=kind.model, topics=topic_of(name, "...")))
        try:
            if not _wait_for_master(
                driver, name, master_address(master), print_progress, lambda: _has_ended(ended, owner)
            ):
                return
            while not _has_ended(ended, owner):
                ended.wait(_OWNER_CHECK_INTERVAL_S)
        finally:
            driver.close()


def _wait_for_master(
    driver: Driver, name: str, address: str, log: Callable[[str], object], is_over: Callable[[], bool]
) -> bool:
    has_waited = False
    while not _try_start(driver):
        if not has_waited:
            message = _("{robot}: no master at {address}; waiting for one. Start Studio or `nep master`")
            log(message.format(robot=name, address=address))
        has_waited = True
        if is_over():
            return False
    message = (
        _("{robot}: found the master at {address}; the robot is ready, press Ctrl+C to stop it")
        if has_waited
        else _("{robot}: the master is at {address}; the robot is ready, press Ctrl+C to stop it")
    )
    log(message.format(robot=name, address=address))
    return True


def _print(text: str, terminal: Terminal) -> None:
    # Terminal drops lines instead of blocking: a full pipe must not stop the robot.
    terminal.write(escaped(text) + "\n")


@contextmanager
def _forward_log(node: nep.Node) -> Iterator[None]:
    root = logging.getLogger()
    root.addHandler(node.log_handler)
    try:
        yield
    finally:
        root.removeHandler(node.log_handler)


def _try_start(driver: Driver) -> bool:
    try:
        driver.start()
    except nep.MasterUnreachable:
        return False
    return True


def _has_ended(ended: threading.Event, owner: psutil.Process | None) -> bool:
    # is_running compares pid and start time, so a reused pid doesn't count.
    return ended.is_set() or (owner is not None and _has_exited(owner))


def _has_exited(owner: psutil.Process) -> bool:
    try:
        return not owner.is_running() or owner.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def _owner_process(pid: int | None) -> psutil.Process | None:
    if pid is None:
        return None
    try:
        return psutil.Process(pid)
    except psutil.NoSuchProcess:
        return None


def _handle_signals(ended: threading.Event) -> None:
    def set_ended(_number: int, _frame: FrameType | None) -> None:
        ended.set()

    signal.signal(signal.SIGTERM, set_ended)
    signal.signal(signal.SIGINT, set_ended)
    if os.name == "nt":
        signal.signal(signal.SIGBREAK, set_ended)  # type: ignore[attr-defined,unused-ignore]
