from __future__ import annotations

import json

from app.ui.blockly.bridge import BlocklyBridge


def test_bridge_sends_json_to_the_page(qtbot):
    bridge = BlocklyBridge(dict)
    with qtbot.waitSignal(bridge.command_sent) as told:
        bridge.send_command("errors", {"a": "“no”"})
    name, payload = told.args
    assert name == "errors"
    assert json.loads(payload) == {"a": "“no”"}


def test_bridge_provides_the_initial_settings_to_the_page():
    bridge = BlocklyBridge(lambda: {"language": "de"})
    assert json.loads(bridge.initial_settings()) == {"language": "de"}


def test_bridge_forwards_page_calls_as_signals(qtbot):
    bridge = BlocklyBridge(dict)
    for slot, signal, args in [
        (bridge.changed, bridge.edited, ["a", 3, "{}"]),
        (bridge.history, bridge.undo_changed, [True, False]),
        (bridge.selected, bridge.block_selected, ["b1"]),
        (bridge.flushed, bridge.workspace_flushed, [7, "{}"]),
        (bridge.failed, bridge.error_reported, ["no command x"]),
        (bridge.ready, bridge.page_ready, []),
    ]:
        with qtbot.waitSignal(signal) as got:
            slot(*args)
        assert got.args == args
