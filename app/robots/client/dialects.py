"""Dialects of robots: how commands are written, how replies are read, and who may send them.

`dialect_of` chooses the dialect from the description of a robot. Other modules ask the dialect what the robot
supports, and never for its name.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from typing import Final, Protocol

from app.robots.client import rize
from app.robots.client.reply import Payload, RobotReply, parse_reply
from app.robots.description.model import Robot
from app.robots.identity import GATEWAY, subscriber_nodes
from nep.programs.robots.moving import COMMAND_TYPE
from nep.protocol.graph_view import GraphView

REPLY_TYPE = "robot/answer"


def new_id(kind: str) -> str:
    """Return a unique id with the prefix ``kind``."""
    return f"{kind}-{uuid.uuid4().hex[:12]}"


def heartbeat(sender: str) -> Payload:
    """Return the heartbeat that keeps a robot in motion.

    Args:
        sender: Id of the program that sends it.
    """
    return {"id": new_id("alive"), "op": "alive", "from": sender, "action": "", "input": {}}


class ClientDialect(Protocol):
    """Dialect that a client uses to command a robot.

    Attributes:
        command_type: Message type of the command topic.
        reply_type: Message type of the reply topic.
        is_identified: True if the robot's own program can be told from others: it announces the robot, and
            its replies, its first reply and its confirmation of a Stop are required.
        can_cancel: True if single actions can be cancelled, and the robot stops without heartbeats.
    """

    command_type: str
    reply_type: str
    is_identified: bool
    can_cancel: bool

    def invoke(self, robot: Robot, task_id: str, sender: str, action: str, input: Payload) -> Payload:
        """Return the command that executes an action.

        Args:
            robot: Description of the robot.
            task_id: Id of the task.
            sender: Id of the program that sends the command.
            action: Name of the action.
            input: Input of the action.

        Raises:
            RobotInputError: The dialect can't express the action with this input.
        """
        ...

    def cancel(self, task_id: str, sender: str, action: str) -> Payload | None:
        """Return the command that cancels a task; None if the dialect has none.

        Args:
            task_id: Id of the task.
            sender: Id of the program that sends the command.
            action: Name of the action.
        """
        ...

    def stop(self, robot: Robot, stop_id: str, sender: str, program_key: str | None = None) -> Payload:
        """Return the command that stops a robot.

        Args:
            robot: Description of the robot.
            stop_id: Id of the stop.
            sender: Id of the program that sends the command.
            program_key: Key of a program whose further commands the robot rejects, if it supports that.
        """
        ...

    def read(self, payload: object) -> RobotReply | None:
        """Parse the payload of a message on the reply topic; return None if it isn't a reply."""
        ...

    def is_own(self, robot: Robot, own_node: str | None, node: str | None, view: GraphView) -> bool | None:
        """Return True if a node is the robot's own program, None if that isn't known yet.

        Args:
            robot: Description of the robot.
            own_node: Id of the node of the robot's own program, if it is known.
            node: Id of the node that sent a message; None if the graph doesn't list it yet.
            view: Newest graph.
        """
        ...


class StudioDialect:
    """Dialect of robots built with Studio's driver kit (docs/robots.md)."""

    command_type: str = COMMAND_TYPE
    reply_type: str = REPLY_TYPE
    is_identified: bool = True
    can_cancel: bool = True

    def invoke(self, robot: Robot, task_id: str, sender: str, action: str, input: Payload) -> Payload:  # noqa: ARG002
        """Return the command that executes an action; see `ClientDialect.invoke`."""
        return {"id": task_id, "op": "invoke", "from": sender, "action": action, "input": dict(input)}

    def cancel(self, task_id: str, sender: str, action: str) -> Payload | None:
        """Return the command that cancels a task."""
        return {"id": task_id, "op": "cancel", "from": sender, "action": action}

    def stop(self, robot: Robot, stop_id: str, sender: str, program_key: str | None = None) -> Payload:
        """Return the command that stops a robot; see `ClientDialect.stop`."""
        command = {"id": stop_id, "op": "stop", "from": sender, "action": robot.safe_stop.action, "input": {}}
        return command if program_key is None else {**command, "ends": program_key}

    def read(self, payload: object) -> RobotReply | None:
        """Parse the payload of a message on the reply topic; return None if it isn't a reply."""
        return parse_reply(payload)

    def is_own(self, robot: Robot, own_node: str | None, node: str | None, view: GraphView) -> bool | None:  # noqa: ARG002
        """Return True only for the node of the robot's own program; see `ClientDialect.is_own`."""
        return None if node is None or own_node is None else node == own_node


class RizeClientDialect:
    """Dialect of RIZE. All its robots share two topics, and their programs can't be told apart."""

    command_type: str = "json"
    reply_type: str = "json"
    is_identified: bool = False
    can_cancel: bool = False

    def invoke(self, robot: Robot, task_id: str, sender: str, action: str, input: Payload) -> Payload:  # noqa: ARG002
        """Return the message for ``robot_action`` that executes an action; see `ClientDialect.invoke`."""
        return rize.to_command(robot, action, input, task_id)

    def cancel(self, task_id: str, sender: str, action: str) -> None:
        """Return None: drivers of RIZE can't cancel a single action."""

    def stop(self, robot: Robot, stop_id: str, sender: str, program_key: str | None = None) -> Payload:  # noqa: ARG002
        """Return the message that stops a robot; drivers of RIZE never confirm it."""
        return rize.to_command(robot, robot.safe_stop.action, {}, stop_id)

    def read(self, payload: object) -> RobotReply | None:
        """Parse the payload of a message on ``action_state``; return None if it isn't a final reply."""
        return parse_reply(rize.from_reply(payload))

    def is_own(self, robot: Robot, own_node: str | None, node: str | None, view: GraphView) -> bool | None:  # noqa: ARG002
        """Return True for subscribers of the robot's commands, the gateway and unknown senders."""
        info = view.nodes.get(node or "")
        is_gateway = info is None or info.generation == GATEWAY
        return is_gateway or node in subscriber_nodes(view, robot.topics.command)


_STUDIO: Final[ClientDialect] = StudioDialect()
_DIALECTS: Final[Mapping[str, ClientDialect]] = {"native": _STUDIO, "rize": RizeClientDialect()}


def dialect_of(robot: Robot) -> ClientDialect:
    """Return the dialect of a robot."""
    return _DIALECTS.get(robot.dialect, _STUDIO)
