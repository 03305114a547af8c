"""The core for tests of panels, and for looking at panels alone: the real one, and nothing of the computer.

What stands for the computer passes the same tests as what it stands for; they are beside it.
"""

from tests.ui.fakes.images import Images, ImageStream, on_topic
from tests.ui.fakes.processes import Runner
from tests.ui.fakes.session import Clock, Session, close_sessions

__all__ = ["Clock", "ImageStream", "Images", "Runner", "Session", "close_sessions", "on_topic"]
