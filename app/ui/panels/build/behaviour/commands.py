"""Description of the behaviour panel with its commands and intents."""

from __future__ import annotations

from typing import Any

from app.intents import PointAtBlock, RenameVariable
from app.ui.intents import (
    DeleteVariable,
    EditBlocks,
    HideBlockHint,
    Redo,
    ShowBlock,
    ShowNextUse,
    ToggleVariableWatch,
    Undo,
    UseEditMenu,
)
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import RowHome
from nep.i18n import _, lazy


def _disabled_reason(context: PanelContext) -> str:
    return "" if context.layout() == "behaviour" else _("Only in the Behaviour layout")


COMMANDS: tuple[Command[BehaviourPanel, PanelContext], ...] = (
    Command("picture.save", lazy("Save blocks as image"), lambda panel: panel.pictures.save_as(), "File",
            icon="image-down", disabled_reason=_disabled_reason, after="file.save_as", opens_panel=False),
    Command("print.ask", lazy("Print blocks"), lambda panel: panel.printing.show_dialog(), "File",
            ("Ctrl+P",), "printer", disabled_reason=_disabled_reason, opens_panel=False),
    Command("print.pdf", lazy("Save blocks as PDF"), lambda panel: panel.printing.ask_save_pdf(), "File",
            icon="file-text", disabled_reason=_disabled_reason, opens_panel=False),
    Command("tab.rename", lazy("Rename the behaviour"), lambda panel: panel.rename_current(), "File",
            ("F2",), "pencil", after="tab.close"),
    Command("picture.copy", lazy("Copy blocks as image"), lambda panel: panel.pictures.copy(), "Edit",
            icon="image", separator_above=True, disabled_reason=_disabled_reason, after="edit.selectAll",
            opens_panel=False),
    Command("blocks.find", lazy("Find in blocks"), lambda panel: panel.find_blocks(to_add=False), "Edit",
            ("Ctrl+F",), "search", separator_above=True, keys_layout="behaviour"),
    Command("blocks.search", lazy("Find and add a block"), lambda panel: panel.find_blocks(to_add=True),
            "Edit"),
    Command("variable.new", lazy("New variable"), lambda panel: panel.variables.new(is_list=False), "Edit",
            icon="variable", separator_above=True),
    Command("variable.new_list", lazy("New list"), lambda panel: panel.variables.new(is_list=True), "Edit",
            icon="list-plus"),
)  # fmt: skip
INTENTS: tuple[IntentHandler[BehaviourPanel, Any], ...] = (
    IntentHandler(Undo, lambda panel, _intent: panel.undo(), opens_panel=False),
    IntentHandler(Redo, lambda panel, _intent: panel.redo(), opens_panel=False),
    IntentHandler(EditBlocks, lambda panel, intent: panel.edit_blocks(intent.edit), opens_panel=False),
    IntentHandler(UseEditMenu, lambda panel, intent: panel.edit_from_menu(intent.edit), opens_panel=False),
    IntentHandler(ShowBlock, lambda panel, intent: panel.show_block(intent.block_id)),
    IntentHandler(PointAtBlock, lambda panel, intent: panel.point_at(intent.block_type)),
    IntentHandler(HideBlockHint, lambda panel, _intent: panel.point_at(""), opens_panel=False),
    IntentHandler(RenameVariable, lambda panel, intent: panel.variables.ask_rename(intent.variable_id)),
    IntentHandler(DeleteVariable, lambda panel, intent: panel.variables.delete(intent.variable_id)),
    IntentHandler(
        ToggleVariableWatch,
        lambda panel, intent: panel.variables.toggle_watch(intent.variable_id),
        opens_panel=False,
    ),
    IntentHandler(ShowNextUse, lambda panel, intent: panel.variables.show_next_use(intent.variable_id)),
)
PANEL = Panel(
    "behaviour",
    lazy("Behaviour"),
    "blocks",
    (),
    BehaviourPanel,
    home=(RowHome("behaviour", 0, 0, 626),),
    commands=COMMANDS,
    intents=INTENTS,
)
