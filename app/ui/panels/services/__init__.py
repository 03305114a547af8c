"""Services: those of the live network, a form for the chosen one, its answer, and what was called before.

`service_list` has the list of them, `request_form` makes fields of a request, `answer` shows what came back.
"""

from app.ui.panels.services.panel import PANEL as PANEL
