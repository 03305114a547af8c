"""Table of the window's own commands and intents; panels contribute theirs in their descriptions.

Menus, palette, shortcuts, tooltips and buttons use the commands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.core.session import Session
from app.intents import (
    AllowOtherComputers,
    BlockFix,
    BrowseNetworks,
    ChooseRecordingsFolder,
    ConnectRobot,
    Inspect,
    Intent,
    OpenBehaviour,
    ReplaceRobot,
    ReportProblem,
    SaveBehaviour,
    SaveBehaviourAs,
    ShowLog,
    ShowRecordingFile,
    StartVirtualRobot,
    StopRobots,
)
from app.robots.virtual_models import VirtualModel, virtual_models
from app.ui.intents import (
    CloseBehaviour,
    CloseOtherTabs,
    DuplicateTab,
    ExportRecording,
    MenuEdit,
    MoveTab,
    OpenPanel,
    OpenRecording,
    PointAtButton,
    PressKey,
    RecordTopic,
    Redo,
    RemoveVirtualRobot,
    RenameTab,
    SaveTab,
    SaveTabAs,
    SelectTab,
    ShowTabFolder,
    TryStack,
    Undo,
)
from app.ui.panels.command import Command, IntentHandler
from app.ui.shell.commands.behaviours import BehaviourCommands
from app.ui.shell.commands.editing import EditCommands
from app.ui.shell.commands.freeze import freeze_buttons
from app.ui.shell.commands.recording import RecordCommands
from app.ui.shell.commands.replay import ReplayCommands
from app.ui.shell.commands.reporting import ReportCommands
from app.ui.shell.commands.robots import RobotCommands
from app.ui.shell.commands.shell import START_PAGE, Shell
from app.ui.shell.commands.view import TEXT_SIZE_STEP_PERCENT, ViewCommands
from app.ui.shell.projects import ProjectController
from app.ui.theme.theme import TEXT_PERCENT_RANGE
from nep.i18n import _, lazy
from nep.version import RELEASES_PAGE

OWN_MODELS = frozenset({"pepper", "diffdrive"})
"""Models of the virtual robots that have a row in the table."""
APPEARANCE_MENU, RECORD_MENU = lazy("Appearance"), lazy("Record")
MENUS = (lazy("File"), lazy("Edit"), lazy("View"), lazy("Run"), lazy("Robots"), lazy("Help"))
RUN_DISABLED_REASONS = {
    "stopping": lazy("Stopping robots"),
    "unanswered": lazy("A robot hasn't confirmed Stop"),
}
NOTHING_TO_RUN_TEXT = lazy("Nothing to run")


@dataclass(frozen=True)
class Handlers:
    """Handlers of all commands, passed to `run` and `disabled_reason` of each command."""

    session: Session
    shell: Shell
    files: ProjectController
    behaviours: BehaviourCommands
    robots: RobotCommands
    view: ViewCommands
    editing: EditCommands
    reports: ReportCommands
    recording: RecordCommands
    replay: ReplayCommands


# Reasons why commands are unavailable, shown in the palette.


def _run_disabled_reason(handlers: Handlers) -> str:
    view = handlers.session.runs.view()
    if view.can_run or view.can_restart:
        return ""
    return _(RUN_DISABLED_REASONS.get(view.state, NOTHING_TO_RUN_TEXT))


def _restart_disabled_reason(handlers: Handlers) -> str:
    return "" if handlers.session.runs.active else _("Nothing is running")


def _pause_disabled_reason(handlers: Handlers) -> str:
    view = handlers.session.runs.view()
    if view.can_pause:
        return ""
    return _("Already paused") if view.state == "paused" else _("Nothing is running")


def _step_disabled_reason(handlers: Handlers) -> str:
    view = handlers.session.runs.view()
    return "" if view.can_step else _(RUN_DISABLED_REASONS.get(view.state, NOTHING_TO_RUN_TEXT))


def _editor_disabled_reason(handlers: Handlers) -> str:
    return "" if handlers.shell.current_layout == "behaviour" else _("Only in the Behaviour layout")


def _panels_disabled_reason(handlers: Handlers) -> str:
    return _("The start page has no panels") if handlers.shell.bench is None else ""


def _custom_layout_disabled_reason(handlers: Handlers) -> str:
    if handlers.shell.saved_layouts.custom_name(handlers.shell.current_layout):
        return ""
    return _panels_disabled_reason(handlers) or _("Built-in layouts can't be changed")


def _previous_layout_disabled_reason(handlers: Handlers) -> str:
    if handlers.shell.current_layout != START_PAGE:
        return _("Only on the start page")
    return "" if handlers.shell.return_layout else _("Nothing is open")


def _freeze_disabled_reason(handlers: Handlers) -> str:
    return "" if freeze_buttons(handlers.shell.bench) else _("Nothing to freeze here")


def _recent_disabled_reason(handlers: Handlers) -> str:
    return "" if handlers.session.settings.all_recent_files else _("The list is empty")


def _open_recording_disabled_reason(handlers: Handlers) -> str:
    return "" if handlers.session.replay is not None else _("No recording is open")


def _loaded_recording_disabled_reason(handlers: Handlers) -> str:
    if handlers.session.replay is None:
        return _open_recording_disabled_reason(handlers)
    return "" if handlers.session.replay.player is not None else _("The recording is still opening")


def _virtual_robot_disabled_reason(handlers: Handlers) -> str:
    return (
        "" if handlers.session.launcher.models_by_name else _("No virtual robot was started in this window")
    )


def _recording_disabled_reason(handlers: Handlers) -> str:
    return "" if handlers.session.recordings.is_recording else _("Not recording")


def _larger_text_disabled_reason(handlers: Handlers) -> str:
    return _("Text is at its largest") if handlers.shell.theme.text_percent >= TEXT_PERCENT_RANGE[1] else ""


def _smaller_text_disabled_reason(handlers: Handlers) -> str:
    return _("Text is at its smallest") if handlers.shell.theme.text_percent <= TEXT_PERCENT_RANGE[0] else ""


C = Command[Handlers, Handlers]


def added_robot_commands() -> tuple[C, ...]:
    """Return the commands that start the virtual robots without a row in the table."""

    def command(robot: VirtualModel) -> C:
        text = _("Use the virtual {robot}").format(robot=robot.name)
        return C(
            f"robots.virtual.{robot.model}",
            text,
            lambda do: do.robots.use_virtual(robot),
            "Robots",
            icon="bot",
        )

    return tuple(command(robot) for robot in virtual_models().values() if robot.model not in OWN_MODELS)


def _panel_command(number: int) -> C:
    return C(
        f"panel.{number}",
        lazy("Go to panel {number}"),
        lambda do: do.shell.panel_focus.focus_at(number),
        keys=(f"Ctrl+{number}",),
        in_palette=False,
        number=number,
    )


def _edit_command(edit: MenuEdit, text: str, key: str, icon: str, *, has_separator: bool = False) -> C:
    # A menu entry only; the focused widget handles its key.
    return C(
        f"edit.{edit}",
        text,
        lambda do: do.editing.run(edit),
        "Edit",
        icon=icon,
        displayed_key=key,
        separator_above=has_separator,
        disabled_reason=lambda do: do.editing.disabled_reason(edit),
        in_palette=False,
        in_shortcuts=False,
    )


def releases_commands(page: str) -> tuple[C, ...]:
    """Return the command that opens the web page of releases, or an empty tuple if there is no such page.

    Args:
        page: URL of the page, or "".
    """
    if not page:
        return ()
    return (
        C("help.releases", lazy("Check for updates"), lambda do: do.reports.open_releases_page(page),
          "Help", icon="external-link", tip=lazy("Opens the releases page in your browser")),
    )  # fmt: skip


COMMANDS: tuple[C, ...] = (
    C("file.new", lazy("New behaviour"), lambda do: do.files.new(), "File", ("Ctrl+N",), "file-plus"),
    C("file.open", lazy("Open a file"), lambda do: do.files.ask_open(), "File", ("Ctrl+O",), "folder-open"),
    C("replay.open", lazy("Open a recording"), lambda do: do.replay.ask_open(), "File", icon="film"),
    C("file.save", lazy("Save"), lambda do: do.files.save(), "File", ("Ctrl+S",), "save",
      separator_above=True),
    C("file.save_as", lazy("Save as"), lambda do: do.files.save_as(), "File", ("Ctrl+Shift+S",),
      "save-pen"),
    C("file.earlier", lazy("Earlier versions"), lambda do: do.behaviours.show_earlier_versions(), "File"),
    C("tab.close", lazy("Close the behaviour"), lambda do: do.behaviours.close(), "File", ("Ctrl+W",), "x"),
    C("tab.reopen", lazy("Reopen closed behaviour"), lambda do: do.files.reopen(), "File",
      ("Ctrl+Shift+T",), "history"),
    C("file.forget_recent", lazy("Clear recent files"), lambda do: do.behaviours.clear_recent(),
      disabled_reason=_recent_disabled_reason),
    C("file.start_page", lazy("Start page"), lambda do: do.view.show_start_page(), "File", ("Alt+Home",),
      "house", separator_above=True, mac_keys=("Ctrl+Shift+H",)),
    C("start_page.leave", lazy("Back to your work"), lambda do: do.view.exit_start_page(), icon="arrow-left",
      in_shortcuts=False, disabled_reason=_previous_layout_disabled_reason),
    C("settings.open", lazy("Settings"), lambda do: do.view.open_settings(), "File", ("Ctrl+,",), "settings"),
    C("file.quit", lazy("Quit"), lambda do: do.shell.close(), "File", ("Ctrl+Q",), separator_above=True),
    C("edit.undo", lazy("Undo"), lambda do: do.shell.request(Undo()), "Edit", ("Ctrl+Z",), "rotate-ccw",
      disabled_reason=_editor_disabled_reason),
    C("edit.redo", lazy("Redo"), lambda do: do.shell.request(Redo()), "Edit", ("Ctrl+Shift+Z", "Ctrl+Y"),
      "rotate-cw", disabled_reason=_editor_disabled_reason),
    _edit_command("cut", lazy("Cut"), "Ctrl+X", "scissors", has_separator=True),
    _edit_command("copy", lazy("Copy"), "Ctrl+C", "copy"),
    _edit_command("paste", lazy("Paste"), "Ctrl+V", "clipboard-paste"),
    _edit_command("selectAll", lazy("Select all"), "Ctrl+A", "text-select"),
    C("palette.open", lazy("Find a command or panel"), lambda do: do.view.open_palette(), "View", ("Ctrl+K",),
      "search", in_palette=False),
    # macOS types special characters with Option (Alt) and reserves Cmd+Tab
    C("layout.behaviour", lazy("Behaviour layout"), lambda do: do.view.show_layout("behaviour"), "View",
      ("Alt+1",), "blocks", group="layout", separator_above=True, mac_keys=("Ctrl+Alt+1",)),
    C("layout.developer", lazy("Developer layout"), lambda do: do.view.show_layout("developer"), "View",
      ("Alt+2",), "activity", group="layout", mac_keys=("Ctrl+Alt+2",)),
    C("layout.keep", lazy("Save layout as"), lambda do: do.view.save_layout(), "View",
      submenu=lazy("Layouts"), disabled_reason=_panels_disabled_reason),
    C("layout.rename", lazy("Rename layout"), lambda do: do.view.rename_layout(), "View",
      submenu=lazy("Layouts"), disabled_reason=_custom_layout_disabled_reason),
    C("layout.delete", lazy("Delete layout"), lambda do: do.view.delete_layout(), "View", icon="trash-2",
      submenu=lazy("Layouts"), disabled_reason=_custom_layout_disabled_reason),
    C("layout.export", lazy("Save layout to a file"), lambda do: do.view.export_layout(), "View",
      icon="download", submenu=lazy("Layouts"), disabled_reason=_panels_disabled_reason),
    C("layout.open", lazy("Open a layout from a file"), lambda do: do.view.ask_layout(), "View",
      icon="folder-open", submenu=lazy("Layouts")),
    C("layout.reset", lazy("Reset panels"), lambda do: do.view.reset_layout(), "View",
      disabled_reason=_panels_disabled_reason),
    C("panel.next", lazy("Next panel"), lambda do: do.shell.panel_focus.focus_next(1), "View", ("F6",),
      disabled_reason=_panels_disabled_reason),
    C("panel.previous", lazy("Previous panel"), lambda do: do.shell.panel_focus.focus_next(-1), "View",
      ("Shift+F6",), disabled_reason=_panels_disabled_reason),
    *map(_panel_command, range(1, 10)),
    C("tab.next", lazy("Next behaviour"), lambda do: do.behaviours.switch_tab(1), "View", ("Ctrl+Tab",),
      separator_above=True, mac_keys=("Meta+Tab", "Ctrl+Shift+]")),
    C("tab.previous", lazy("Previous behaviour"), lambda do: do.behaviours.switch_tab(-1), "View",
      ("Ctrl+Shift+Tab",), mac_keys=("Meta+Shift+Tab", "Ctrl+Shift+[")),
    C("view.freeze", lazy("Freeze display"), lambda do: do.view.toggle_frozen_panels(), "View",
    icon="snowflake",
      tip=lazy("Freezes the Inspector and images"), is_checkable=True, separator_above=True,
      disabled_reason=_freeze_disabled_reason),
    C("replay.live", lazy("Back to live"), lambda do: do.replay.return_to_live(), "View", icon="radio-tower",
      tip=lazy("Closes the recording and returns to the live network"), separator_above=True,
      disabled_reason=_open_recording_disabled_reason),
    C("replay.play", lazy("Play recording"), lambda do: do.replay.toggle_playback(), icon="play",
      disabled_reason=_loaded_recording_disabled_reason),
    C("replay.bookmark", lazy("Add bookmark"), lambda do: do.replay.add_bookmark(), icon="bookmark",
      disabled_reason=_loaded_recording_disabled_reason),
    C("theme.light", lazy("Light"), lambda do: do.view.set_theme("light"), "View", icon="sun", group="theme",
      submenu=APPEARANCE_MENU),
    C("theme.dark", lazy("Dark"), lambda do: do.view.set_theme("dark"), "View", icon="moon", group="theme",
      submenu=APPEARANCE_MENU),
    C("theme.system", lazy("Match system"), lambda do: do.view.set_theme("system"), "View", icon="monitor",
      group="theme", submenu=APPEARANCE_MENU),
    C("text.larger", lazy("Larger text"),
      lambda do: do.view.set_text_size(do.shell.theme.text_percent + TEXT_SIZE_STEP_PERCENT), "View",
      ("Ctrl++", "Ctrl+="),
      "zoom-in", separator_above=True, disabled_reason=_larger_text_disabled_reason),
    C("text.smaller", lazy("Smaller text"),
      lambda do: do.view.set_text_size(do.shell.theme.text_percent - TEXT_SIZE_STEP_PERCENT), "View",
      ("Ctrl+-",),
      "zoom-out",
      disabled_reason=_smaller_text_disabled_reason),
    C("text.normal", lazy("Normal text"), lambda do: do.view.set_text_size(100), "View", ("Ctrl+0",)),
    C("theme.contrast", lazy("High contrast"), lambda do: do.view.update_contrast(), "View",
      is_checkable=True,
      submenu=APPEARANCE_MENU, separator_above=True),
    C("theme.motion", lazy("Reduce motion"), lambda do: do.view.update_motion(), "View", is_checkable=True,
      submenu=APPEARANCE_MENU),
    C("run.run", lazy("Run"), lambda do: do.behaviours.run_or_resume(), "Run", ("F5",), "play",
      lazy("Runs the behaviour, or restarts it"), disabled_reason=_run_disabled_reason),
    C("run.restart", lazy("Restart"), lambda do: do.behaviours.restart(), "Run", ("Ctrl+F5",), "rotate-ccw",
      lazy("Stops the program and runs the behaviour in its current state"),
      disabled_reason=_restart_disabled_reason),
    C("run.pause", lazy("Pause"), lambda do: do.session.runs.pause(), "Run", ("F8",), "pause",
      lazy("Pauses the program and its robots"), disabled_reason=_pause_disabled_reason),
    C("run.step", lazy("Step"), lambda do: do.behaviours.run_step(), "Run", ("F10",), "step-forward",
      lazy("Runs one block"), disabled_reason=_step_disabled_reason),
    C("run.full_speed", lazy("Full speed"), lambda do: do.session.runs.set_pace(0.0), "Run", group="pace",
      separator_above=True),
    C("run.slow", lazy("Slow motion: 0.5 s per block"), lambda do: do.session.runs.set_pace(0.5), "Run",
      group="pace"),
    C("run.very_slow", lazy("Very slow: 1.5 s per block"), lambda do: do.session.runs.set_pace(1.5), "Run",
      group="pace"),
    C("run.from_start", lazy("Reset robots to their start position before each run"),
      lambda do: do.robots.toggle_reset_before_run(), "Run", is_checkable=True, separator_above=True,
      tip=lazy("Virtual robots return to their start position before each run")),
    # two keys: on Macs and many laptops F12 changes the volume
    C("run.stop", lazy("Stop the program and all robots"), lambda do: do.session.runs.stop(), "Run",
      ("F12", "Ctrl+."), "square", lazy("Stops the program and every robot"), separator_above=True,
      in_all_windows=True),
    C("run.confirm", lazy("Not playing"), lambda do: do.session.runs.confirm_stopped(), in_palette=False,
      in_shortcuts=False),
    C("robots.virtual", lazy("Use the virtual Pepper"), lambda do: do.robots.use_virtual_pepper(), "Robots",
      icon="bot"),
    C("robots.turtle", lazy("Use the virtual Turtle"),
      lambda do: do.robots.use_virtual(virtual_models()["diffdrive"]), "Robots", icon="bot"),
    *added_robot_commands(),
    C("robots.end_virtual", lazy("Remove virtual robots"), lambda do: do.robots.stop_virtual(), "Robots",
      disabled_reason=_virtual_robot_disabled_reason),
    # unlike "robots.virtual" without changing the layout
    C("robots.start", lazy("Start the virtual Pepper"), lambda do: do.robots.start_pepper(), in_palette=False,
      in_shortcuts=False),
    C("robots.ask", lazy("Ask again before real robots move"),
      lambda do: do.robots.revoke_motion_permissions(),
      "Robots", icon="footprints"),
    C("network.others", lazy("Let other computers connect"), lambda do: do.robots.open_network_access(),
      "Robots", icon="wifi", separator_above=True),
    C("network.look", lazy("Browse other robot networks"), lambda do: do.robots.open_other_networks(),
      "Robots",
      icon="waypoints"),
    C("network.web", lazy("Web pages and tablets"), lambda do: do.robots.open_web_pages(), "Robots",
      icon="globe"),
    C("alerts.show", lazy("Alerts"), lambda do: do.shell.open_panel("alerts"), in_palette=False,
      in_shortcuts=False),
    C("recording.toggle", lazy("Start or stop recording"), lambda do: do.recording.toggle(), "View",
      ("Ctrl+R",), "circle-dot", lazy("Records messages of programs until stopped"), submenu=RECORD_MENU),
    C("recording.stop", lazy("Stop recording"), lambda do: do.session.recordings.stop(), icon="circle-dot",
      in_shortcuts=False, disabled_reason=_recording_disabled_reason),
    C("recording.sheet", lazy("Choose topics to record"), lambda do: do.recording.open_sheet(), "View",
      icon="list-checks", submenu=RECORD_MENU),
    C("recording.keep", lazy("Save the last seconds"), lambda do: do.recording.save_last(), "View", ("F9",),
      "history", lazy("Saves what just happened as a recording"), submenu=RECORD_MENU, separator_above=True),
    C("recording.folder", lazy("Folder for recordings"), lambda do: do.recording.ask_folder(), "View",
      icon="folder-open", submenu=RECORD_MENU, separator_above=True),
    C("recording.show", lazy("Recordings"), lambda do: do.recording.show(), "View", icon="film",
      submenu=RECORD_MENU, in_palette=False),
    C("help.first_steps", lazy("First steps"), lambda do: do.view.show_first_steps(), "Help",
      icon="lightbulb"),
    C("help.guide", lazy("Guide"), lambda do: do.view.open_guide(), "Help", icon="book-open"),
    C("help.examples", lazy("Examples"), lambda do: do.view.show_examples(), "Help", icon="blocks"),
    C("help.shortcuts", lazy("Keyboard shortcuts"), lambda do: do.view.open_shortcuts(), "Help", ("F1",),
      "keyboard"),
    C("help.report", lazy("Report a problem"), lambda do: do.reports.report(), "Help",
      icon="message-square-warning", separator_above=True),
    C("help.log", lazy("Show the log"), lambda do: do.view.open_log_folder(), "Help", icon="folder-open"),
    *releases_commands(RELEASES_PAGE),
    C("help.about", lazy("About NEP Studio"), lambda do: do.view.open_about(), "Help", icon="info",
      separator_above=True),
)  # fmt: skip


INTENT_COMMANDS: Mapping[type[Intent], str] = {
    ShowLog: "help.log",
    StopRobots: "run.stop",
    SaveBehaviour: "file.save",
    SaveBehaviourAs: "file.save_as",
    OpenBehaviour: "file.open",
    ChooseRecordingsFolder: "recording.folder",
    BrowseNetworks: "network.look",
    AllowOtherComputers: "network.others",
    ReportProblem: "help.report",
}
"""Commands that carry out intents."""
INTENTS: tuple[IntentHandler[Handlers, Any], ...] = (
    IntentHandler(OpenPanel, lambda do, intent: do.shell.open_panel(intent.panel) is not None),
    IntentHandler(Inspect, lambda do, intent: do.view.inspect(intent.topic)),
    IntentHandler(RecordTopic, lambda do, intent: do.recording.record_topic(intent.topic)),
    IntentHandler(OpenRecording, lambda do, intent: do.replay.open(intent.path)),
    IntentHandler(ExportRecording, lambda do, intent: do.recording.show_for_export(intent.path)),
    IntentHandler(ShowRecordingFile, lambda do, intent: do.replay.show_folder(intent.path)),
    IntentHandler(PressKey, lambda do, intent: do.view.run_shortcut(intent.key)),
    IntentHandler(PointAtButton, lambda do, intent: do.view.point_at(intent.command)),
    IntentHandler(TryStack, lambda do, intent: do.behaviours.try_stack(intent.stack)),
    IntentHandler(SelectTab, lambda do, intent: do.behaviours.show_tab(intent.key)),
    IntentHandler(CloseBehaviour, lambda do, intent: do.behaviours.close_tab(intent.key)),
    IntentHandler(CloseOtherTabs, lambda do, intent: do.behaviours.close_other_tabs(intent.key)),
    IntentHandler(SaveTab, lambda do, intent: do.behaviours.save_tab(intent.key)),
    IntentHandler(SaveTabAs, lambda do, intent: do.behaviours.save_tab_as(intent.key)),
    IntentHandler(RenameTab, lambda do, intent: do.behaviours.rename_tab(intent.key, intent.name)),
    IntentHandler(DuplicateTab, lambda do, intent: do.behaviours.duplicate_tab(intent.key)),
    IntentHandler(ShowTabFolder, lambda do, intent: do.behaviours.show_folder(intent.key)),
    IntentHandler(MoveTab, lambda do, intent: do.behaviours.move_tab(intent.key, intent.position)),
    IntentHandler(ConnectRobot, lambda do, intent: do.robots.reconnect(intent.name)),
    IntentHandler(ReplaceRobot, lambda do, intent: do.robots.replace_robot(intent)),
    IntentHandler(RemoveVirtualRobot, lambda do, intent: do.robots.stop_virtual(intent.name)),
    IntentHandler(StartVirtualRobot, lambda do, intent: do.robots.start_virtual_model(intent.missing)),
    IntentHandler(BlockFix, lambda do, intent: do.files.fix(intent)),
)
"""Intents that the window carries out itself; tabs are identified by the key of their document."""
