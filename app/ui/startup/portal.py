"""The desktop's own file dialogs on Linux: by its portal, when that answers on the session's bus.

Qt asks the portal when its platform theme "xdgdesktopportal" is chosen before the application is made.
Without a bus nothing is loaded and nothing waited for.
"""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from pathlib import Path

THEME, CHOICE = "xdgdesktopportal", "QT_QPA_PLATFORMTHEME"
NAME, OBJECT = "org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop"
CHOOSER = "org.freedesktop.portal.FileChooser"
LONGEST_MS = 300


def has_bus(environ: MutableMapping[str, str]) -> bool:
    """Whether there is a session's bus to ask."""
    if environ.get("DBUS_SESSION_BUS_ADDRESS"):
        return True
    folder = environ.get("XDG_RUNTIME_DIR")
    return bool(folder) and (Path(folder or "") / "bus").is_socket()


def chooser_answers() -> bool:
    """Whether the portal has a dialog for files; False within 0.3 s when it does not say."""
    from PySide6.QtDBus import QDBusConnection, QDBusMessage  # noqa: PLC0415 - only where there is a bus

    bus = QDBusConnection.connectToBus(QDBusConnection.BusType.SessionBus, "studio-portal")
    try:
        if not bus.isConnected():
            return False
        ask = QDBusMessage.createMethodCall(NAME, OBJECT, "org.freedesktop.DBus.Properties", "Get")
        ask.setArguments([CHOOSER, "version"])
        return bus.call(ask, timeout=LONGEST_MS).type() == QDBusMessage.MessageType.ReplyMessage
    finally:
        QDBusConnection.disconnectFromBus("studio-portal")


def use_portal(
    environ: MutableMapping[str, str], platform: str, answers: Callable[[], bool] = chooser_answers
) -> None:
    """Choose the portal's dialogs where they are; a theme that somebody chose stays.

    ``platform`` as `sys.platform` says it. Call it before the application is made.
    """
    if platform.startswith("linux") and not environ.get(CHOICE) and has_bus(environ) and answers():
        environ[CHOICE] = THEME


def has_system_dialogs(environ: MutableMapping[str, str], platform: str) -> bool:
    """Whether the system's file dialogs are to be used: on Windows and macOS, and on Linux by the portal."""
    return platform in {"win32", "darwin"} or environ.get(CHOICE) == THEME
