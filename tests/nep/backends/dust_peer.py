"""Program that uses another vendor's DDS: `dust_peer.py hear|say TOPIC [latched]`.

`hear` prints each received text as a line. `say` publishes each line that it reads.
"""

import os
import sys
from dataclasses import dataclass

import dust_dds


@dataclass
class String:
    data: str


String.__name__ = "std_msgs::msg::dds_::String_"  # its DDS type name
WAIT = dust_dds.Duration(sec=60, nanosec=0)
KEPT = dust_dds.HistoryQosPolicy(dust_dds.HistoryQosPolicyKind.KeepLast(100))
"""History depth; with the default, readers keep one message and writers wait for acknowledgements."""


def tell(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def wait(entity, status) -> None:
    condition = entity.get_statuscondition()
    condition.set_enabled_statuses([status])
    waiting = dust_dds.WaitSet()
    waiting.attach_condition(dust_dds.Condition.StatusCondition(condition))
    waiting.wait(WAIT)


def hear(participant, topic, durability) -> None:
    reliable = dust_dds.DEFAULT_RELIABILITY_QOS_POLICY_DATA_WRITER
    qos = dust_dds.DataReaderQos(reliability=reliable, history=KEPT, durability=durability)
    reader = participant.create_subscriber().create_datareader(topic, qos=qos)
    tell("ready")
    wait(reader, dust_dds.StatusKind.SubscriptionMatched)
    tell("matched")
    while True:
        wait(reader, dust_dds.StatusKind.DataAvailable)
        for sample in reader.take(max_samples=10):
            tell(sample.get_data().data)


def say(participant, topic, durability) -> None:
    writer = participant.create_publisher().create_datawriter(
        topic, qos=dust_dds.DataWriterQos(history=KEPT, durability=durability)
    )
    tell("ready")
    for line in sys.stdin:
        writer.write(String(line.strip()))


def main(what: str, name: str, kept: str = "") -> None:
    factory = dust_dds.DomainParticipantFactory.get_instance()
    participant = factory.create_participant(domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    topic = participant.create_topic(topic_name=name, type_=String)
    kind = dust_dds.DurabilityQosPolicyKind
    durability = dust_dds.DurabilityQosPolicy(kind.TransientLocal if kept else kind.Volatile)
    {"hear": hear, "say": say}[what](participant, topic, durability)


main(*sys.argv[1:])
