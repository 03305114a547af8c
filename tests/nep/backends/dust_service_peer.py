"""Program that serves or calls as rmw_cyclonedds does, with another vendor's DDS: `serve|call NAME TYPE`.

A server prints its requests. A client prints the replies to the requests that it reads as lines: JSON,
[a, b].
"""

import json
import os
import sys
from dataclasses import dataclass

import dust_dds
from dust_dds import TypeKind

# dust-dds can't read 64-bit integers in Python: each is sent as two halves, the lower one first.


@dataclass
class Request:
    guid: TypeKind.uint32
    guid_high: TypeKind.uint32
    sequence_number: TypeKind.uint32
    sequence_number_high: TypeKind.uint32
    a: TypeKind.uint32
    a_high: TypeKind.uint32
    b: TypeKind.uint32
    b_high: TypeKind.uint32


@dataclass
class Response:
    guid: TypeKind.uint32
    guid_high: TypeKind.uint32
    sequence_number: TypeKind.uint32
    sequence_number_high: TypeKind.uint32
    sum: TypeKind.uint32
    sum_high: TypeKind.uint32


Request.__name__ = "example_interfaces::srv::dds_::AddTwoInts_Request_"  # their DDS type names
Response.__name__ = "example_interfaces::srv::dds_::AddTwoInts_Response_"
GUID = 0xFEDCBA9876543210
WAIT = dust_dds.Duration(sec=60, nanosec=0)
KEPT = dust_dds.HistoryQosPolicy(dust_dds.HistoryQosPolicyKind.KeepLast(10))


def halves(number: int) -> tuple[int, int]:
    return number & 0xFFFFFFFF, number >> 32 & 0xFFFFFFFF


def whole(low: int, high: int) -> int:
    number = low | high << 32
    return number - 2**64 if number >= 2**63 else number


def tell(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def wait(entity, status) -> None:
    condition = entity.get_statuscondition()
    condition.set_enabled_statuses([status])
    waiting = dust_dds.WaitSet()
    waiting.attach_condition(dust_dds.Condition.StatusCondition(condition))
    waiting.wait(WAIT)


def taken(reader):
    while True:
        wait(reader, dust_dds.StatusKind.DataAvailable)
        for sample in reader.take(max_samples=10):
            yield sample.get_data()


def main(what: str, name: str, _kind: str) -> None:
    factory = dust_dds.DomainParticipantFactory.get_instance()
    participant = factory.create_participant(domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    asking = participant.create_topic(topic_name=f"rq/{name}Request", type_=Request)
    answering = participant.create_topic(topic_name=f"rr/{name}Reply", type_=Response)
    heard, said = (asking, answering) if what == "serve" else (answering, asking)
    reliable = dust_dds.DEFAULT_RELIABILITY_QOS_POLICY_DATA_WRITER
    reader = participant.create_subscriber().create_datareader(
        heard, qos=dust_dds.DataReaderQos(reliability=reliable, history=KEPT)
    )
    writer = participant.create_publisher().create_datawriter(said, qos=dust_dds.DataWriterQos(history=KEPT))
    if what == "serve":
        tell("ready")
        for asked in taken(reader):
            a, b = whole(asked.a, asked.a_high), whole(asked.b, asked.b_high)
            tell(json.dumps([a, b]))
            caller = (asked.guid, asked.guid_high, asked.sequence_number, asked.sequence_number_high)
            writer.write(Response(*caller, *halves(a + b)))
    wait(reader, dust_dds.StatusKind.SubscriptionMatched)
    while not writer.get_matched_subscriptions():
        pass
    tell("ready")
    answers = (each for each in taken(reader) if (each.guid, each.guid_high) == halves(GUID))
    for number, line in enumerate(sys.stdin, 1):
        a, b = json.loads(line)
        writer.write(Request(*halves(GUID), number, 0, *halves(a), *halves(b)))
        answer = next(answers)
        assert (answer.sequence_number, answer.sequence_number_high) == (number, 0)
        tell(json.dumps([whole(answer.sum, answer.sum_high)]))


main(*sys.argv[1:])
