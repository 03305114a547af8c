"""Program that serves or calls as rmw_cyclonedds does, with Cyclone DDS alone: `serve|call NAME TYPE`.

TYPE is SetBool, Trigger or AddTwoInts. The program shares no code with nep: each struct is written out.
A server prints its requests. A client prints the replies to the requests that it reads as lines (JSON,
a list of the fields). The program publishes no type information except the names of the types, as ROS 2
does.
"""

import json
import os
import sys
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
@final
class SetBoolRequest(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Request_"):
    guid: uint64
    sequence_number: int64
    data: bool


@dataclass
@final
class SetBoolResponse(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Response_"):
    guid: uint64
    sequence_number: int64
    success: bool
    message: str


@dataclass
@final
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    guid: uint64
    sequence_number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
@final
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    guid: uint64
    sequence_number: int64
    success: bool
    message: str


@dataclass
@final
class AddTwoIntsRequest(IdlStruct, typename="example_interfaces::srv::dds_::AddTwoInts_Request_"):
    guid: uint64
    sequence_number: int64
    a: int64
    b: int64


@dataclass
@final
class AddTwoIntsResponse(IdlStruct, typename="example_interfaces::srv::dds_::AddTwoInts_Response_"):
    guid: uint64
    sequence_number: int64
    sum: int64


TYPES = {
    "SetBool": (SetBoolRequest, SetBoolResponse, lambda asked: (asked.data, f"set to {asked.data}")),
    "Trigger": (TriggerRequest, TriggerResponse, lambda _asked: (True, "grüß")),
    "AddTwoInts": (AddTwoIntsRequest, AddTwoIntsResponse, lambda asked: (asked.a + asked.b,)),
}
GUID = 0xFEDCBA9876543210
QOS = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.Durability.Volatile,
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)


def tell(line: object) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def serve(reader, writer, response, answer) -> None:
    tell("ready")
    while True:
        for asked in reader.take_iter(timeout=duration(seconds=60)):
            tell(json.dumps([getattr(asked, name) for name in list(asked.__dataclass_fields__)[2:]]))
            writer.write(response(asked.guid, asked.sequence_number, *answer(asked)))


def call(reader, writer, request) -> None:
    tell("ready")
    for number, line in enumerate(sys.stdin, 1):
        writer.write(request(GUID, number, *json.loads(line)))
        for said in reader.take_iter(timeout=duration(seconds=60)):
            if said.guid == GUID:
                assert said.sequence_number == number
                tell(json.dumps([getattr(said, name) for name in list(said.__dataclass_fields__)[2:]]))
                break


def main(what: str, name: str, kind: str) -> None:
    request, response, answer = TYPES[kind]
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    asking = Topic(participant, f"rq/{name}Request", request)
    answering = Topic(participant, f"rr/{name}Reply", response)
    if what == "serve":
        reader, writer = DataReader(participant, asking, QOS), DataWriter(participant, answering, QOS)
        serve(reader, writer, response, answer)
    else:
        reader, writer = DataReader(participant, answering, QOS), DataWriter(participant, asking, QOS)
        while not (writer.get_matched_subscriptions() and reader.get_matched_publications()):
            pass
        call(reader, writer, request)


main(*sys.argv[1:])
