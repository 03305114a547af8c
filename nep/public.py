"""Public names of nep. The package `nep` imports this module at the first access to one of them."""

from nep.backends.connection import Configuration as Configuration
from nep.backends.connection import Direct as Direct
from nep.backends.connection import Hybrid as Hybrid
from nep.errors import AddressInUseError as AddressInUseError
from nep.errors import BackendUnavailableError as BackendUnavailableError
from nep.errors import BadKeyError as BadKeyError
from nep.errors import BadNameError as BadNameError
from nep.errors import BadTopicError as BadTopicError
from nep.errors import BadValueError as BadValueError
from nep.errors import ClosedError as ClosedError
from nep.errors import DecodeError as DecodeError
from nep.errors import EncodeError as EncodeError
from nep.errors import MasterUnreachable as MasterUnreachable
from nep.errors import NepError as NepError
from nep.errors import NoServerError as NoServerError
from nep.errors import NoValueError as NoValueError
from nep.errors import ParameterError as ParameterError
from nep.errors import RequestRefusedError as RequestRefusedError
from nep.errors import ServerGoneError as ServerGoneError
from nep.errors import ServiceError as ServiceError
from nep.errors import ServiceTimeoutError as ServiceTimeoutError
from nep.errors import TooManyFilesError as TooManyFilesError
from nep.errors import UnknownBackendError as UnknownBackendError
from nep.errors import WaitTimeoutError as WaitTimeoutError
from nep.masters.master import Master as Master
from nep.masters.master import is_running as is_running
from nep.masters.master import master_address as master_address
from nep.masters.master import start_process as start_process
from nep.messages.encoded import Encoded as Encoded
from nep.messages.image_codec import ImageFormat as ImageFormat
from nep.messages.image_codec import raw_image as raw_image
from nep.messages.message import Message as Message
from nep.nodes.node import Node as Node
from nep.nodes.node import spin as spin
from nep.nodes.original import FixedClient as FixedClient
from nep.nodes.original import FixedServer as FixedServer
from nep.nodes.original import dict2json as dict2json
from nep.nodes.original import getMyIP as getMyIP
from nep.nodes.original import json2dict as json2dict
from nep.nodes.original import read_json as read_json
from nep.nodes.publisher import Publisher as Publisher
from nep.nodes.subscriber import Subscriber as Subscriber
from nep.nodes.timer import Timer as Timer
from nep.patterns.parameters.node_parameters import Parameters as Parameters
from nep.patterns.parameters.parameter import NodeParameter as NodeParameter
from nep.patterns.parameters.remote import RemoteParameters as RemoteParameters
from nep.patterns.services.client import Client as Client
from nep.patterns.services.server import Server as Server
from nep.patterns.services.survey import Respondent as Respondent
from nep.patterns.services.survey import Surveyor as Surveyor
from nep.programs.blackboard.board import Blackboard as Blackboard
from nep.programs.blackboard.board import BlackboardChange as BlackboardChange
from nep.programs.blackboard.board import BlackboardEntry as BlackboardEntry
from nep.programs.blackboard.watch import BlackboardWatch as BlackboardWatch
from nep.protocol.graph_view import Alert as Alert
from nep.protocol.graph_view import ClientInfo as ClientInfo
from nep.protocol.graph_view import GraphView as GraphView
from nep.protocol.graph_view import NodeInfo as NodeInfo
from nep.protocol.graph_view import PatternInfo as PatternInfo
from nep.protocol.graph_view import PublisherInfo as PublisherInfo
from nep.protocol.graph_view import ServerInfo as ServerInfo
from nep.protocol.graph_view import ServiceInfo as ServiceInfo
from nep.protocol.graph_view import SubscriberInfo as SubscriberInfo
from nep.protocol.graph_view import TopicInfo as TopicInfo

node = Node
"""Alias of `Node`, in the spelling of the NEP paper."""

server = FixedServer
"""Alias of `FixedServer`, as in the original module."""

client = FixedClient
"""Alias of `FixedClient`, as in the original module."""

master = Master
"""Alias of `Master`."""
