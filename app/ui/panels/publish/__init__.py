"""Publish panel: saved messages that can be edited and sent once or repeatedly.

`shelf_list` lists the messages, `message_form` edits one, `value_fields` has the fields for its placeholders.
"""

from app.ui.panels.publish.panel import PANEL as PANEL
