"""Channel between the window and the page of the block editor, over QWebChannel.

Each call carries one message as JSON (`app.ui.blockly.messages`). The messages of each direction arrive in
the order in which they were sent.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal, Slot

from app.ui.blockly import messages
from app.ui.blockly.messages import PageMessage, WindowMessage
from nep.system.log_rarely import is_logged
from nep.text import bounded_str

_log = logging.getLogger(__name__)


class BlocklyBridge(QObject):
    """Object that the page accesses as ``bridge``.

    Args:
        receive: Called with each valid message from the page.

    Attributes:
        refused_count: Number of invalid messages from the page, which were ignored.
    """

    message_sent = Signal(str)  # to the page: a message as JSON

    def __init__(self, receive: Callable[[PageMessage], None], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._receive = receive
        self.refused_count = 0

    def send(self, message: WindowMessage) -> None:
        """Send a message to the page."""
        self.message_sent.emit(messages.encode(message))

    @Slot(str)
    def message(self, text: str) -> None:
        """Handle a message from the page. An invalid message is counted and logged, not raised."""
        try:
            message = messages.decode(text)
        except (ValueError, RecursionError) as error:
            self.refused_count += 1
            if is_logged(self.refused_count):
                _log.warning(
                    "refused a message from the page of the block editor (%d so far): %s",
                    self.refused_count,
                    bounded_str(error),
                )
            return
        self._receive(message)
