"""The self-test by which every package of Studio is tested: what it may take, its report, its watch.

`surroundings` gives it a folder, a home and a master of its own, `report` is what it leaves there, `test` is
the whole: the steps' times, what ends it when nothing moves any more, and what is left of its processes. What
it does in the window is in `app.ui.self_test`.
"""

from app.core.self_test.surroundings import UnwritableFolderError as UnwritableFolderError
from app.core.self_test.surroundings import prepare as prepare
from app.core.self_test.test import SelfTest as SelfTest
