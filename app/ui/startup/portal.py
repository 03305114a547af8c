"""Native file dialogs on Linux, through the XDG desktop portal on the session bus.

Qt uses the portal if its platform theme "xdgdesktopportal" is selected before the application is
created. Without a session bus, no module is loaded and the startup isn't delayed.
"""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from pathlib import Path

PORTAL_THEME, THEME_VARIABLE = "xdgdesktopportal", "QT_QPA_PLATFORMTHEME"
SERVICE_NAME, OBJECT_PATH = "org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop"
FILE_CHOOSER_INTERFACE = "org.freedesktop.portal.FileChooser"
REPLY_TIMEOUT_MS = 300


def has_bus(environ: MutableMapping[str, str]) -> bool:
    """Return True if the environment variables refer to a D-Bus session bus."""
    if environ.get("DBUS_SESSION_BUS_ADDRESS"):
        return True
    folder = environ.get("XDG_RUNTIME_DIR")
    return bool(folder) and (Path(folder or "") / "bus").is_socket()


def has_file_chooser() -> bool:
    """Return True if the desktop portal has a file chooser; False if it doesn't reply within 0.3 s."""
    from PySide6.QtDBus import QDBusConnection, QDBusMessage  # noqa: PLC0415 - only where there is a bus

    bus = QDBusConnection.connectToBus(QDBusConnection.BusType.SessionBus, "studio-portal")
    try:
        if not bus.isConnected():
            return False
        request = QDBusMessage.createMethodCall(
            SERVICE_NAME, OBJECT_PATH, "org.freedesktop.DBus.Properties", "Get"
        )
        request.setArguments([FILE_CHOOSER_INTERFACE, "version"])
        return bus.call(request, timeout=REPLY_TIMEOUT_MS).type() == QDBusMessage.MessageType.ReplyMessage
    finally:
        QDBusConnection.disconnectFromBus("studio-portal")


def use_portal(
    environ: MutableMapping[str, str], platform: str, is_available: Callable[[], bool] = has_file_chooser
) -> None:
    """Select the portal's file dialogs if they are available; call this before the application is created.

    Args:
        environ: Environment variables, modified in place. A platform theme that is already set isn't
            changed.
        platform: Value of `sys.platform`.
        is_available: Returns True if the portal has a file chooser.
    """
    if (
        platform.startswith("linux")
        and not environ.get(THEME_VARIABLE)
        and has_bus(environ)
        and is_available()
    ):
        environ[THEME_VARIABLE] = PORTAL_THEME


def has_system_dialogs(environ: MutableMapping[str, str], platform: str) -> bool:
    """Return True if the platform has native file dialogs: Windows, macOS, and Linux with the portal."""
    return platform in {"win32", "darwin"} or environ.get(THEME_VARIABLE) == PORTAL_THEME
