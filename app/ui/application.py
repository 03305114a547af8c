"""Startup and shutdown of the window: scheme, fonts, theme, session, panels, commands."""

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

from PySide6.QtCore import QCoreApplication, QLibraryInfo, QLocale, Qt, QTimer, QTranslator
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication

from app import resources
from app.core.alerts import Alerts
from app.core.documents.journal import left_behind, of_newer
from app.core.documents.versions import bring_here
from app.core.reports import studio_versions
from app.core.reports.crash_reports import CrashLog, CrashReports, offer
from app.core.reports.not_installed import missing_libraries, tell_missing
from app.core.reports.studio_run import StudioRun
from app.core.session import Session
from app.core.storage.file_lock import FileLock
from app.core.storage.settings import home
from app.ui.panels.registry import PanelRegistry
from app.ui.self_drive import SelfDrive
from app.ui.shell.bars.logo import LogoEngine
from app.ui.shell.main_window import MainWindow
from app.ui.shell.start_page.page import read_examples
from app.ui.shell.window_state import WindowState, fitting
from app.ui.speaker import QtSpeaker
from app.ui.startup import graphics, interpreter, portal, qt_log, sandbox, single_instance
from app.ui.startup.deferred import DeferredSteps
from app.ui.startup.file_open import Application, IncomingFiles
from app.ui.startup.single_instance import StartRequest
from app.ui.theme import fonts
from app.ui.theme.theme import MODES, Theme
from nep.i18n import ENGLISH, _, language, listed

LOG_INTERVAL_MS = 500
RESTART = -1
"""Result of `run` when the user requested a restart."""
FIRST_START_KEY = "begun"  # key of the setting that marks the first start as done
WEB_VIEW = "app.ui.blockly.view"
SOON = (
    "app.ui.shell.dialogs.command_palette",
    "app.ui.shell.dialogs.settings",
    "app.ui.shell.dialogs.shortcuts",
)
"""Modules imported in advance after the first paint."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Options:
    """Command-line options of the window."""

    files: tuple[Path, ...] = ()
    demo: bool = False
    theme: str | None = None
    self_drive: Path | None = None
    new_window: bool = False
    drive: Callable[[MainWindow], SelfDrive] | None = None
    """Creates a driver of the window, used from before it is shown until it closes."""
    web: bool = True
    """Load the block editor's web page; False avoids loading the web engine."""

    @property
    def alone(self) -> bool:
        """True if the window neither receives start requests of other processes nor saves its tabs."""
        return self.new_window or self.self_drive is not None or self.drive is not None


def make_application() -> QApplication:
    """Return the QApplication, creating it with name and fonts on first use."""
    existing = QApplication.instance()
    if isinstance(existing, QApplication):
        return existing
    interpreter.shorten_switch_interval()
    graphics.draw_by_software(os.environ, sys.platform)
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontShowIconsInMenus)
    application = Application(sys.argv[:1])
    application.setApplicationName("nep-studio")
    application.setApplicationDisplayName("NEP Studio")
    application.setDesktopFileName("nep-studio")
    translate_qt(application)
    refused = fonts.load()
    if refused:
        words = _("Qt can't load the fonts {fonts}; using others").format(fonts=", ".join(refused))
        sys.stderr.write(f"{words}\n")
    return application


def translate_qt(application: QCoreApplication) -> QTranslator | None:
    """Load Qt's own translations for the current language; return None if there are none."""
    if language() == ENGLISH:
        return None
    translator = QTranslator(application)
    folder = QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)
    if not translator.load(QLocale(language()), "qtbase", "_", folder):
        return None
    application.installTranslator(translator)
    return translator


def steps_after(window: MainWindow, *, web: bool = True) -> list[Callable[[], object]]:
    """Return the startup steps for the time after the first paint.

    They create panels, import modules and load the block editor.
    """
    panels = window.panels.steps() if isinstance(window.panels, PanelRegistry) else ()
    modules = (partial(importlib.import_module, name) for name in SOON)
    view = (partial(import_web_view, window.session.alerts),) if web else ()
    return [*panels, *modules, *view, *window.steps_ahead()]


def import_web_view(alerts: Alerts) -> None:
    """Import the block editor, or raise an alert that names the missing system libraries."""
    try:
        importlib.import_module(WEB_VIEW)
    except ImportError as error:
        missing = missing_libraries(error)
        if missing is None:
            raise
        tell_missing(alerts, missing)
        sys.stderr.write(f"nep-studio: {missing.title} {missing.remedy}\n")


def make_window(session: Session, options: Options) -> MainWindow:
    """Create the window and restore its last state; the event loop is not running yet."""
    theme = Theme("light")
    # must come first: before the event loop runs, Qt doesn't notify widgets of a changed font
    WindowState(session.settings, _log.warning).apply_theme(theme)
    chosen = next((mode for mode in MODES if mode == options.theme), None)
    if chosen is not None:
        theme.set_mode(chosen)
    window = MainWindow(session, theme, PanelRegistry(), read_examples(resources.folder() / "examples"))
    window.setWindowIcon(QIcon(LogoEngine(theme)))
    if not window.state.place(window):
        window.resize(fitting(window.size(), window.screen().availableSize()))
    if not options.alone:
        window.commands.behaviours.come_back(left_behind(), window.banner.offer)
        tell_of_what_was_found(session)
    return window


def tell_of_what_was_found(session: Session) -> None:
    """Raise alerts for stored files that can't be used: settings, and unsaved work of a newer version."""
    if session.settings.notice:
        session.alerts.put("settings:notice", "warn", session.settings.notice)
    names = of_newer()
    if names:
        session.alerts.put(
            "journal:newer",
            "warn",
            _("A newer version of NEP Studio has unsaved work here: {names}.").format(
                names=listed([f"“{name}”" for name in names])
            ),
            _("Start that version to restore it."),
        )


def tell_of_crashes(session: Session, this_run: StudioRun) -> None:
    """Log earlier runs that crashed. Offer a problem report once for those since the last start."""
    reports = CrashReports()
    for crash in this_run.left():
        reports.add(crash)
    offer(session.alerts, reports)


def keep_version(window: MainWindow, now_s: float) -> None:
    """Save a changed version in the settings, where problem reports read it."""
    settings = window.session.settings
    kept = studio_versions.with_this_version(settings.all(), now_s, is_first=settings.are_new)
    if kept is not None:
        window.state.keep(studio_versions.KEY, kept)


def close_when_asked(window: MainWindow, this_run: StudioRun) -> None:
    """Close the window on SIGINT, SIGTERM and SIGHUP."""

    def close(_number: int, _frame: FrameType | None) -> None:
        this_run.expect_end()
        QTimer.singleShot(0, window.close)

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # nohup ignores SIGHUP so that the process outlives the terminal
        if number is not None and (name != "SIGHUP" or signal.getsignal(number) == signal.SIG_DFL):
            signal.signal(number, close)
    application = QApplication.instance()
    if isinstance(application, QApplication):
        application.commitDataRequest.connect(
            lambda _manager: this_run.expect_end(), Qt.ConnectionType.DirectConnection
        )


def open_asked(window: MainWindow, asked: StartRequest) -> None:
    """Execute a start request of this process or of one that was started later."""
    if asked.files:
        window.commands.files.open_all(asked.files)
    elif asked.demo:
        window.commands.behaviours.demo()
    if window.isVisible():
        window.setWindowState(window.windowState() & ~Qt.WindowState.WindowMinimized)
        window.raise_()
        window.activateWindow()


def layout_left(window: MainWindow) -> str:
    """Return the name of the last layout, or "" for the start page if that layout has no content."""
    last = window.state.layout
    there = {"developer": True, "behaviour": any(not each.blank for each in window.session.documents)}
    return last if there.get(last, False) else ""


def offer_first_steps(window: MainWindow, *, asked: bool) -> None:
    """Offer the first steps on the very first start.

    Skipped if ``asked`` names files to open, or unsaved work is offered. The first start is recorded
    immediately, so that it counts even after a crash.
    """
    if not window.session.settings.are_new:
        return
    window.state.keep(FIRST_START_KEY, True)
    if not asked and not window.banner.offers and all(each.blank for each in window.session.documents):
        window.start.offer_first_steps()
        window.start.focus_first()


def first_steps(window: MainWindow, options: Options) -> list[Callable[[], object]]:
    """Show the first page and return the steps that complete it after the first paint."""
    left = "" if options.alone else layout_left(window)
    asked = bool(options.files or options.demo)
    if options.self_drive is not None:
        window.begin()
        # The self-drive starts the demonstration itself.
        open_asked(window, StartRequest(options.files, demo=False))
        return []
    offer_first_steps(window, asked=asked)
    if not asked and not left:
        return [window.begin]

    def show() -> None:
        if asked:
            open_asked(window, StartRequest(options.files, options.demo))
        else:
            window.commands.view.show_layout(left)
        if window.bench is None:  # the file can't be opened, which an alert explains
            window.show_start()

    window.expect("behaviour" if asked else left)
    return [window.begin, show]


def why_not(environ: Mapping[str, str], platform: str, user: int) -> str:
    """Return the reason why no window can be opened, with the remedy; "" if one can.

    Args:
        environ: Environment variables.
        platform: Value of `sys.platform`.
        user: Id of the user; 0 is root.
    """
    if not platform.startswith("linux"):
        return ""
    if not any(environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")):
        return _(
            "no screen found (DISPLAY and WAYLAND_DISPLAY are not set). Start Studio on a desktop, or "
            "run a behaviour without a window: nep-studio run FILE"
        )
    if user == 0 and not environ.get("QTWEBENGINE_DISABLE_SANDBOX"):
        return _(
            "The block editor's browser can't run as root with its sandbox. Start Studio as another "
            "user or, if there is no other way, set QTWEBENGINE_DISABLE_SANDBOX=1"
        )
    return ""


def run(options: Options) -> int:
    """Show the window until it is closed.

    Returns:
        Exit code 0, 2 if no window can be opened, or `RESTART`.
    """
    bring_here()
    meeting_place = single_instance.place(home())
    turn = FileLock(home() / "starting")
    if not options.alone and single_instance.found(
        meeting_place, StartRequest(options.files, options.demo), turn
    ):
        return 0
    refused = why_not(os.environ, sys.platform, os.geteuid() if hasattr(os, "geteuid") else 1)
    if refused:
        sys.stderr.write(f"nep-studio: {refused}\n")
        return 2
    log = qt_log.listen()
    qt_log.quiet_chromium(os.environ)
    trial = sandbox.begin_trial(os.environ, sys.platform)
    portal.use_portal(os.environ, sys.platform)
    logging.getLogger().addHandler(CrashLog(CrashReports()))
    application = make_application()
    with StudioRun() as this_run:
        return _show(application, options, log, this_run, (meeting_place, turn), trial)


def _show(
    application: QApplication,
    options: Options,
    log: qt_log.Log,
    this_run: StudioRun,
    single: tuple[str, FileLock],
    trial: sandbox.SandboxTrial | None,
) -> int:
    # Returns the exit code.
    session = Session()
    window = make_window(session, options)
    application.setQuitOnLastWindowClosed(False)
    window.on_shut = lambda: QTimer.singleShot(0, application.quit)
    window.can_restart = not options.alone  # other windows don't restore their tabs
    close_when_asked(window, this_run)
    hearing = QTimer(window)
    hearing.timeout.connect(lambda: log.drain(session.console.add))
    hearing.start(LOG_INTERVAL_MS)
    speaker = session.voices.speaker = QtSpeaker()
    soon = DeferredSteps(window, steps_after(window, web=options.web))
    driver = options.drive(window) if options.drive is not None else None
    window.show()
    window.activateWindow()  # without a window manager the window would get no focus
    first = first_steps(window, options)
    if options.self_drive is None:
        first.append(partial(tell_of_crashes, session, this_run))
    if not options.alone:
        meeting_place, turn = single
        first.append(partial(keep_version, window, time.time()))
        first.append(
            lambda: single_instance.SingleInstanceServer(meeting_place, partial(open_asked, window), window)
        )
        first.append(turn.release)
        first.append(partial(session.last_robots.start, session.launcher))
    soon.put_first(first)
    IncomingFiles(window, window.commands.files.open_all)
    if isinstance(application, Application):
        application.open_files_with(window.commands.files.open_all)
    if driver is None and options.self_drive is not None:
        driver = SelfDrive(window, options.self_drive)
    sandbox.fit_sandbox(os.environ, trial)  # requires the event loop, which creates the page
    code = application.exec()
    speaker.close()
    if driver is not None and not driver.well:
        return 1
    return RESTART if window.wants_restart else code
