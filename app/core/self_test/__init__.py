"""Self-test for testing packages of Studio: time limits, report, watchdog.

`surroundings` gives it a folder, a home and a master of its own, `report` is its result, `test` runs the
steps with time limits, a watchdog against hanging, and a check for remaining processes. The steps in the
window are in `app.ui.self_test`.
"""

from app.core.self_test.surroundings import UnwritableFolderError as UnwritableFolderError
from app.core.self_test.surroundings import prepare as prepare
from app.core.self_test.test import SelfTest as SelfTest
