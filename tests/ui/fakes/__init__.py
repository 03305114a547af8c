"""Fake core for tests of panels: the real core without network, processes and files.

The fakes pass the same tests as the real classes; these tests are in this package.
"""

from tests.ui.fakes.images import Images, ImageStream, on_topic
from tests.ui.fakes.processes import Runner
from tests.ui.fakes.session import Clock, Session, close_sessions

__all__ = ["Clock", "ImageStream", "Images", "Runner", "Session", "close_sessions", "on_topic"]
