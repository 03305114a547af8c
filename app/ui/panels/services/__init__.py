"""Services panel: services of the live network, with request form, reply and earlier calls.

`service_list` has the list, `request_form` the fields of a request, `answer` the reply.
"""

from app.ui.panels.services.panel import PANEL as PANEL
