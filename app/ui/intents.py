"""Commands of the window that carry out the next steps of alerts."""

from __future__ import annotations

from collections.abc import Mapping

from app.core.alerts.intents import (
    AllowOtherComputers,
    BrowseNetworks,
    ChooseRecordingsFolder,
    ConnectRobot,
    Inspect,
    Intent,
    OpenBehaviour,
    OpenDoctor,
    ReportProblem,
    SaveBehaviour,
    SaveBehaviourAs,
    ShowAlarms,
    ShowConsole,
    ShowLog,
    ShowRecordingFile,
    StopRobots,
)

_COMMANDS: Mapping[type[Intent], str] = {
    OpenDoctor: "help.doctor",
    ShowLog: "help.log",
    ShowConsole: "panel:console",
    ShowAlarms: "panel:alarms",
    StopRobots: "run.stop",
    SaveBehaviour: "file.save",
    SaveBehaviourAs: "file.save_as",
    OpenBehaviour: "file.open",
    ChooseRecordingsFolder: "recording.folder",
    BrowseNetworks: "network.look",
    AllowOtherComputers: "network.others",
    ReportProblem: "help.report",
}


def command_of(intent: Intent) -> str:
    """Return the command that carries out an intent, as `PanelContext.run` expects it."""
    match intent:
        case Inspect():
            return f"inspect:{intent.topic}"
        case ConnectRobot():
            return f"connect:{intent.name}"
        case ShowRecordingFile():
            return f"recording.folder:{intent.path}"
        case _:
            return _COMMANDS[type(intent)]
