"""Self-test of packaged builds of Studio: steps with time limits, a report, and a watchdog.

`environment` creates a separate folder, home folder and master, and `report` writes the result. `test`
runs the steps and the watchdog, and checks for processes that were left behind. The steps in the window
are in `app.ui.self_test`.
"""

from app.core.self_test.environment import UnwritableFolderError as UnwritableFolderError
from app.core.self_test.environment import prepare as prepare
from app.core.self_test.test import SelfTest as SelfTest
