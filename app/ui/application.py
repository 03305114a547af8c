"""Startup and shutdown of the graphical user interface."""

from __future__ import annotations

import importlib
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from PySide6.QtCore import QCoreApplication, QLibraryInfo, QLocale, Qt, QTimer, QTranslator
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication

from app import resources
from app.core.alerts.alerts import Alerts
from app.core.projects.journal import newer_work_names, unsaved_work
from app.core.projects.versions import move_old_versions
from app.core.reports import studio_versions
from app.core.reports.crash_reports import CrashLog, CrashReports, show_crash_alert
from app.core.reports.not_installed import alert_missing, missing_libraries
from app.core.reports.studio_run import StudioRun
from app.core.session import Session
from app.core.storage.file_lock import FileLock
from app.core.storage.folders import home
from app.core.storage.settings import Settings
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.bars.logo import LogoEngine
from app.ui.shell.main_window import MainWindow
from app.ui.shell.start_page.page import read_examples
from app.ui.shell.window_state import WindowState, initial_size
from app.ui.speaker import QtSpeaker
from app.ui.startup import graphics, interpreter, portal, qt_log, sandbox, single_instance
from app.ui.startup.deferred import DeferredSteps
from app.ui.startup.file_open import Application, FileDropFilter
from app.ui.startup.single_instance import StartRequest
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from nep.i18n import ENGLISH, _, format_list, language
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui import self_drive as driving
else:
    driving = lazy_module("app.ui.self_drive")

LOG_INTERVAL_MS = 500
RESTART_EXIT_CODE = -1
"""Result of `run` when the user requested a restart."""
WEB_VIEW_MODULE = "app.ui.blockly.view"
PRELOADED_MODULES = (
    "app.blocks.compiler.compiler",
    "app.blocks.fixes.fixes",
    "app.blocks.toolbox.definitions",
    "app.ui.shell.dialogs.command_palette",
    "app.ui.shell.dialogs.network_access",
    "app.ui.shell.dialogs.other_networks",
    "app.ui.shell.dialogs.settings",
    "app.ui.shell.dialogs.shortcuts",
    "app.ui.shell.dialogs.web_pages",
)
"""Modules to import after the first paint, so that their first use isn't delayed."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Options:
    """Command-line options of the window.

    Attributes:
        files: Files to open.
        starts_demo: True to open the first example and start a virtual robot.
        theme: Theme to use instead of the saved one: "light", "dark" or "system".
        self_drive: Folder for the screenshots of an unattended run, or None for normal use.
        opens_new_window: True to open a window even if Studio is already running.
    """

    files: tuple[Path, ...] = ()
    starts_demo: bool = False
    theme: str | None = None
    self_drive: Path | None = None
    opens_new_window: bool = False
    make_driver: Callable[[MainWindow], driving.SelfDrive] | None = None
    """Factory of the `SelfDrive` that operates the window; called before the window is shown."""
    loads_web_view: bool = True
    """True to load the block editor's web page; False avoids the start of the web engine."""

    @property
    def is_standalone(self) -> bool:
        """True if the window is independent of other instances.

        Such a window doesn't receive start requests of other processes and doesn't save its tabs.
        """
        return self.opens_new_window or self.self_drive is not None or self.make_driver is not None


def make_application() -> QApplication:
    """Return the QApplication, creating it with its name and fonts on first use."""
    existing = QApplication.instance()
    if isinstance(existing, QApplication):
        return existing
    interpreter.shorten_switch_interval()
    graphics.use_software_renderer(os.environ, sys.platform)
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontShowIconsInMenus)
    application = Application(sys.argv[:1])
    application.setApplicationName("nep-studio")
    application.setApplicationDisplayName("NEP Studio")
    application.setDesktopFileName("nep-studio")
    translate_qt(application)
    failed_fonts = fonts.load()
    if failed_fonts:
        message = _("Qt can't load the fonts {fonts}; using fallback fonts").format(
            fonts=", ".join(failed_fonts)
        )
        sys.stderr.write(f"{message}\n")
    return application


def translate_qt(application: QCoreApplication) -> QTranslator | None:
    """Install Qt's own translations for the current language.

    Returns:
        The installed translator, or None if the language is English or Qt has no translation for it.
    """
    if language() == ENGLISH:
        return None
    translator = QTranslator(application)
    folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
    if not translator.load(QLocale(language()), "qtbase", "_", folder):
        return None
    application.installTranslator(translator)
    return translator


def deferred_steps(window: MainWindow, *, loads_web_view: bool = True) -> list[Callable[[], object]]:
    """Return the startup steps to run after the first paint, before panels are created.

    The steps import modules and load the block editor.

    Args:
        loads_web_view: True to load the block editor.
    """
    panels = window.panels.import_steps() if isinstance(window.panels, PanelRegistry) else ()
    modules = (partial(importlib.import_module, name) for name in PRELOADED_MODULES)
    view = (partial(import_web_view, window.session.alerts),) if loads_web_view else ()
    return [*panels, *modules, *view]


def import_web_view(alerts: Alerts) -> None:
    """Import the block editor; if system libraries are missing, raise an alert that names them.

    Any other `ImportError` is raised.
    """
    try:
        importlib.import_module(WEB_VIEW_MODULE)
    except ImportError as error:
        missing = missing_libraries(error)
        if missing is None:
            raise
        alert_missing(alerts, missing)
        sys.stderr.write(f"nep-studio: {missing.title} {missing.remedy}\n")


def make_window(session: Session, options: Options) -> MainWindow:
    """Create the window and restore its last state. Called before the event loop runs."""
    theme = Theme("light")
    if options.theme is not None:
        session.settings.override(Settings.theme, Settings.theme.parse(options.theme))
    # must come first: before the event loop runs, Qt doesn't notify widgets of a changed font
    WindowState(session.settings, _log.warning).apply_theme(theme)
    window = MainWindow(session, theme, PanelRegistry(), read_examples(resources.folder() / "examples"))
    window.setWindowIcon(QIcon(LogoEngine(theme)))
    if not window.state.restore_geometry(window):
        window.resize(initial_size(window.size(), window.screen().availableSize()))
    if not options.is_standalone:
        window.commands.behaviours.restore_tabs(unsaved_work(), window.banner.offer)
        raise_startup_alerts(session)
    return window


def raise_startup_alerts(session: Session) -> None:
    """Raise alerts for stored data that can't be used.

    These are invalid settings, and unsaved work of a newer version.
    """
    if session.settings.notice:
        session.alerts.raise_alert("settings:notice", "warn", session.settings.notice)
    names = newer_work_names()
    if names:
        session.alerts.raise_alert(
            "journal:newer",
            "warn",
            _("There is unsaved work from a newer version of NEP Studio: {names}.").format(
                names=format_list([f"“{name}”" for name in names])
            ),
            _("Start that version to restore it."),
        )


def report_crashes(session: Session, this_run: StudioRun) -> None:
    """Store crash reports of earlier runs, and offer a problem report for crashes since the last start."""
    reports = CrashReports()
    for crash in this_run.pop_crashes():
        reports.add(crash)
    show_crash_alert(session.alerts, reports)


def save_version(window: MainWindow, now_s: float) -> None:
    """Add this version to the version history in the settings if it is new; problem reports include it.

    Args:
        now_s: Current Unix time in s.
    """
    settings = window.session.settings
    versions = studio_versions.add_this_version(settings.studio_versions, now_s, is_first=settings.are_new)
    if versions is not None:
        window.state.save(Settings.studio_versions, versions)


def close_on_signals(window: MainWindow, this_run: StudioRun) -> None:
    """Close the window on SIGINT, SIGTERM and SIGHUP.

    An exit because of these signals or the end of the desktop session isn't recorded as a crash.
    """

    def close(_number: int, _frame: FrameType | None) -> None:
        this_run.expect_exit()
        QTimer.singleShot(0, window.close)

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # nohup ignores SIGHUP so that the process outlives the terminal
        if number is not None and (name != "SIGHUP" or signal.getsignal(number) == signal.SIG_DFL):
            signal.signal(number, close)
    application = QApplication.instance()
    if isinstance(application, QApplication):
        application.commitDataRequest.connect(
            lambda _manager: this_run.expect_exit(), Qt.ConnectionType.DirectConnection
        )


def handle_start_request(window: MainWindow, request: StartRequest) -> None:
    """Execute a start request and bring the window to the front.

    Args:
        request: Request of this process, or of a process that was started later.
    """
    if request.files:
        window.commands.files.open_all(request.files)
    elif request.starts_demo:
        window.commands.behaviours.start_demo()
    if window.isVisible():
        window.setWindowState(window.windowState() & ~Qt.WindowState.WindowMinimized)
        window.raise_()
        window.activateWindow()


def last_layout(window: MainWindow) -> str:
    """Return the name of the layout to show at startup, or "" for the start page.

    This is the last layout if it was Developer, or Behaviour with a behaviour that isn't empty.
    """
    last = window.state.layout
    has_content = {
        "developer": True,
        "behaviour": any(not each.is_blank for each in window.session.documents),
    }
    return last if has_content.get(last, False) else ""


def offer_first_steps(window: MainWindow, *, has_request: bool) -> None:
    """Offer the first steps if Studio was never started before.

    The first start is recorded immediately, so that it is not repeated after a crash. Nothing is
    offered if there is unsaved work to recover or if an open behaviour isn't empty.

    Args:
        has_request: True if the command line names files or the demonstration; nothing is offered
            then.
    """
    if not window.session.settings.are_new:
        return
    window.state.save(Settings.is_started_before, True)
    if (
        not has_request
        and not window.banner.has_offer
        and all(each.is_blank for each in window.session.documents)
    ):
        window.start.offer_first_steps()
        window.start.focus_first()


def show_first_page(window: MainWindow, options: Options) -> list[Callable[[], object]]:
    """Prepare the first page and return the steps that complete it after the first paint.

    With a self-drive, the session is started immediately and there are no steps.
    """
    layout = "" if options.is_standalone else last_layout(window)
    has_request = bool(options.files or options.starts_demo)
    if options.self_drive is not None:
        window.start_session()
        # The self-drive starts the demonstration itself.
        handle_start_request(window, StartRequest(options.files, starts_demo=False))
        return []
    offer_first_steps(window, has_request=has_request)
    if not has_request and not layout:
        return [window.start_session]

    def show() -> None:
        if has_request:
            handle_start_request(window, StartRequest(options.files, options.starts_demo))
        else:
            window.commands.view.show_layout(layout)
        if window.bench is None:  # the file can't be opened, which an alert explains
            window.show_start()

    window.show_placeholder("behaviour" if has_request else layout)
    return [window.start_session, show]


def startup_problem(environ: Mapping[str, str], platform: str, user_id: int) -> str:
    """Return the reason why the window can't be opened, with a remedy; "" if it can be opened.

    Args:
        environ: Environment variables.
        platform: Value of `sys.platform`.
        user_id: Id of the user; 0 is root.
    """
    if not platform.startswith("linux"):
        return ""
    if not any(environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")):
        return _(
            "no screen found (DISPLAY and WAYLAND_DISPLAY aren't set); start Studio on a desktop, or "
            "run a behaviour without a window: nep-studio run FILE"
        )
    if user_id == 0 and not environ.get("QTWEBENGINE_DISABLE_SANDBOX"):
        return _(
            "the block editor's browser can't run as root with its sandbox; start Studio as another user "
            "or, if there is no other way, set QTWEBENGINE_DISABLE_SANDBOX=1"
        )
    return ""


def run(options: Options) -> int:
    """Show the window and run the event loop until the window is closed.

    If Studio is already running, its window opens the files instead, and this function returns 0.

    Returns:
        The exit code: 0 on success, 1 if an unattended run failed, 2 if no window can be opened, or
        `RESTART_EXIT_CODE`.
    """
    move_old_versions()
    instance_socket = single_instance.socket_name(home())
    start_lock = FileLock(home() / "starting")
    if not options.is_standalone and single_instance.pass_to_running(
        instance_socket, StartRequest(options.files, options.starts_demo), start_lock
    ):
        return 0
    problem = startup_problem(os.environ, sys.platform, os.geteuid() if hasattr(os, "geteuid") else 1)
    if problem:
        sys.stderr.write(f"nep-studio: {problem}\n")
        return 2
    console_handler = qt_log.install_handlers()
    qt_log.quiet_chromium(os.environ)
    sandbox_test = sandbox.start_test(os.environ, sys.platform)
    portal.use_portal(os.environ, sys.platform)
    logging.getLogger().addHandler(CrashLog(CrashReports()))
    application = make_application()
    with StudioRun() as this_run:
        return _run_window(
            application, options, console_handler, this_run, (instance_socket, start_lock), sandbox_test
        )


def _run_window(
    application: QApplication,
    options: Options,
    console_handler: qt_log.ConsoleHandler,
    this_run: StudioRun,
    socket_and_lock: tuple[str, FileLock],
    sandbox_test: sandbox.SandboxTest | None,
) -> int:
    # Returns the exit code.
    session = Session()
    window = make_window(session, options)
    application.setQuitOnLastWindowClosed(False)
    window.on_closed = lambda: QTimer.singleShot(0, application.quit)
    window.can_restart = not options.is_standalone  # other windows don't restore their tabs
    close_on_signals(window, this_run)
    log_timer = QTimer(window)
    log_timer.timeout.connect(lambda: console_handler.drain(session.console.add))
    log_timer.start(LOG_INTERVAL_MS)
    speaker = session.voices.speaker = QtSpeaker()
    steps = deferred_steps(window, loads_web_view=options.loads_web_view)
    deferred = DeferredSteps(window, [*steps, lambda: deferred.prepend(window.preload_steps())])
    driver = options.make_driver(window) if options.make_driver is not None else None
    window.show()
    window.activateWindow()  # without a window manager the window would get no focus
    startup_steps = show_first_page(window, options)
    if options.self_drive is None:
        startup_steps.append(partial(report_crashes, session, this_run))
    if not options.is_standalone:
        instance_socket, start_lock = socket_and_lock
        startup_steps.append(partial(save_version, window, time.time()))
        startup_steps.append(
            lambda: single_instance.SingleInstanceServer(
                instance_socket, partial(handle_start_request, window), window
            )
        )
        startup_steps.append(start_lock.release)
        startup_steps.append(partial(session.last_robots.start, session.launcher))
    deferred.prepend(startup_steps)
    FileDropFilter(window, window.commands.files.open_all)
    if isinstance(application, Application):
        application.set_file_opener(window.commands.files.open_all)
    if driver is None and options.self_drive is not None:
        driver = driving.SelfDrive(window, options.self_drive)
    sandbox.configure_sandbox(os.environ, sandbox_test)  # requires the event loop, which creates the page
    code = application.exec()
    speaker.close()
    if driver is not None and not driver.has_succeeded:
        return 1
    return RESTART_EXIT_CODE if window.wants_restart else code
