"""Sheet "Web pages and tablets": permissions, QR code, connected pages, and rejected requests.

The server and its settings are in `app.core.network.web_pages`.
"""

from app.ui.shell.dialogs.web_pages.sheet import WebPagesSheet as WebPagesSheet
