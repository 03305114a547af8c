"""NEP: messages between robots, programs and people.

import nep

node = nep.node("python_sender")
pub = node.new_pub("example", "json")
pub.publish({"message": "hello"})
"""

import importlib

TYPE_CHECKING = False
"""As `typing` has it, whose import would take ten times as long as this module."""

if TYPE_CHECKING:
    from nep.backends.connection import Configuration, Direct, Hybrid
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
    from nep.masters.graph import Alert, GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo
    from nep.masters.master import Master, is_running, master_address, start_process
    from nep.messages.encoded import Encoded
    from nep.messages.image_codec import raw_image
    from nep.messages.message import Message
    from nep.nodes.node import Node
    from nep.nodes.publisher import Publisher, Subscriber
    from nep.version import __version__

    node = Node
    """A node; see `Node`. The paper's spelling."""

    master = Master
    """A master; see `Master`."""

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

_FROM = {
    "nep.backends.connection": ("Configuration", "Direct", "Hybrid"),
    "nep.messages.encoded": ("Encoded",),
    "nep.errors": (
        "AddressInUseError",
        "BackendUnavailableError",
        "BadNameError",
        "BadTopicError",
        "ClosedError",
        "DecodeError",
        "EncodeError",
        "MasterUnreachable",
        "NepError",
        "RequestRefusedError",
        "TooManyFilesError",
        "UnknownBackendError",
        "WaitTimeoutError",
    ),
    "nep.masters.graph": ("Alert", "GraphView", "NodeInfo", "PublisherInfo", "SubscriberInfo", "TopicInfo"),
    "nep.messages.image_codec": ("raw_image",),
    "nep.masters.master": ("Master", "is_running", "master_address", "start_process"),
    "nep.messages.message": ("Message",),
    "nep.nodes.node": ("Node",),
    "nep.nodes.publisher": ("Publisher", "Subscriber"),
    "nep.version": ("__version__",),
}
"""The imports above, for `_imported`."""

_PAPER = {"node": "Node", "master": "Master"}


def _imported(name: str) -> object:
    """What the package has under this name; all of it is imported when anything of it is first asked for.

    So `import nep` takes a millisecond, and the command `nep`, which begins with it, can be told what Ctrl+C
    does before it imports the rest. All at once: a program that has opened all the files that it may, or has
    left its folder, must not find a part of nep missing an hour later. Raises `AttributeError`.
    """
    if name in __all__ and name != "__version__":
        for module, names in _FROM.items():
            loaded = importlib.import_module(module)
            globals().update({each: getattr(loaded, each) for each in names})
        globals().update({paper: globals()[known] for paper, known in _PAPER.items()})
        return globals()[name]
    found = importlib.import_module("nep.version").__version__ if name == "__version__" else _submodule(name)
    globals()[name] = found
    return found


def _submodule(name: str) -> object:
    """`nep.errors` and the like, which `import nep` alone has always given."""
    whole = f"nep.{name}"
    try:
        if not name.startswith("_"):
            return importlib.import_module(whole)
    except ModuleNotFoundError as error:
        if error.name != whole:
            raise
    raise AttributeError(f"module 'nep' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


if not TYPE_CHECKING:  # which would take any name for one of ours
    __getattr__ = _imported
