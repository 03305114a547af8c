"""Self-test for checking packages of Studio: steps with time limits, a report, and a watchdog.

`surroundings` creates a separate folder, home folder and master. `report` writes the result. `test` runs the
steps with time limits and a watchdog, and checks for processes that are left. The steps in the window are in
`app.ui.self_test`.
"""

from app.core.self_test.surroundings import UnwritableFolderError as UnwritableFolderError
from app.core.self_test.surroundings import prepare as prepare
from app.core.self_test.test import SelfTest as SelfTest
