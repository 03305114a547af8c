"""NEP: messages between robots, programs and people.

import nep

node = nep.node("python_sender")
pub = node.new_pub("example", "json")
pub.publish({"message": "hello"})
"""

from nep.configuration import Configuration, Direct, Hybrid
from nep.encoded import Encoded
from nep.errors import (
    AddressInUseError,
    BackendUnavailableError,
    BadNameError,
    BadTopicError,
    ClosedError,
    DecodeError,
    EncodeError,
    MasterUnreachable,
    NepError,
    RequestRefusedError,
    TooManyFilesError,
    UnknownBackendError,
    WaitTimeoutError,
)
from nep.graph import Alert, GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo
from nep.images import raw_image
from nep.masters import Master, is_running, master_address, start_process
from nep.message import Message
from nep.nodes import Node
from nep.pubsub import Publisher, Subscriber
from nep.version import __version__

__all__ = [
    "AddressInUseError",
    "Alert",
    "BackendUnavailableError",
    "BadNameError",
    "BadTopicError",
    "ClosedError",
    "Configuration",
    "DecodeError",
    "Direct",
    "EncodeError",
    "Encoded",
    "GraphView",
    "Hybrid",
    "Master",
    "MasterUnreachable",
    "Message",
    "NepError",
    "Node",
    "NodeInfo",
    "Publisher",
    "PublisherInfo",
    "RequestRefusedError",
    "Subscriber",
    "SubscriberInfo",
    "TooManyFilesError",
    "TopicInfo",
    "UnknownBackendError",
    "WaitTimeoutError",
    "__version__",
    "is_running",
    "master",
    "master_address",
    "node",
    "raw_image",
    "start_process",
]

node = Node
"""A node; see `Node`. The paper's spelling."""

master = Master
"""A master; see `Master`."""
