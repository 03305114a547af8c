"""Start a rosbridge server of ROS 1 from its sources with Debian's rospy, for `paper.py`.

    python bench/rosbridge.py SOURCES HOST PORT

SOURCES is a folder with rosbridge_suite, branch ros1; the ROS master is $ROS_MASTER_URI. rosbridge is
in no package registry, and its sources need a ROS workspace. This program replaces the parts of it
that they use: the messages that describe connected clients, and the lookup of a topic's type.
Services, rosapi and authentication are not available. The server listens at HOST only, which
rosbridge does not do by default. Needs Python up to 3.11 with roslibpy (for autobahn), tornado and
pymongo.
"""

from __future__ import annotations

import functools
import runpy
import sys
import types
from pathlib import Path
from typing import Any

from nep.backends.ros.library import get_rospy

CLIENTS = """ConnectedClient[] clients
================================================================================
MSG: rosbridge_msgs/ConnectedClient
string ip_address
time connection_time
"""


def module(name: str, **content: object) -> None:
    """Register a module with this content, so that it can be imported."""
    made = types.ModuleType(name)
    vars(made).update(content)
    sys.modules[name] = made


def topic_type(topic: str, *_rest: object) -> tuple[str | None, str | None, None]:
    """Return the type of a published topic, in the form of rostopic's `get_topic_type`."""
    import rospy  # type: ignore[import-not-found] # noqa: PLC0415 - `library` has found it

    found = dict(rospy.get_published_topics()).get(topic)
    return found, topic if found else None, None


def main(arguments: list[str]) -> None:
    """Run the server until the process is stopped."""
    sources, host, port = arguments
    get_rospy()
    import genpy.dynamic  # type: ignore[import-not-found] # noqa: PLC0415
    import roslib.launcher  # type: ignore[import-not-found] # noqa: PLC0415
    from autobahn.twisted import websocket  # type: ignore[import-not-found] # noqa: PLC0415

    made: dict[str, Any] = genpy.dynamic.generate_dynamic("rosbridge_msgs/ConnectedClients", CLIENTS)
    messages = {name.partition("/")[2]: each for name, each in made.items()}
    for package in ("rosbridge_msgs", "rosauth"):
        module(package)
    module("rosbridge_msgs.msg", **messages)
    module("rosauth.srv", Authentication=None)
    module("rostopic", get_topic_type=topic_type)
    module("rosservice", get_service_type=lambda _name: None)
    roslib.load_manifest = roslib.launcher.load_manifest = lambda *_words: None
    websocket.listenWS = functools.partial(websocket.listenWS, interface=host)
    for package in ("rosbridge_server", "rosbridge_library"):
        sys.path.insert(0, str(Path(sources, package, "src")))
    program = Path(sources, "rosbridge_server", "scripts", "rosbridge_websocket.py")
    sys.argv = [str(program), "--port", port, "--address", host]
    runpy.run_path(str(program), run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
