"""Topics of Cyclone DDS whose samples are already encoded as CDR.

The sample class of a topic has the members of the ROS message, for the type description in discovery.
rosbags encodes and decodes the samples.
"""

from __future__ import annotations

from typing import Any

from nep.backends.ros2.library import Dds
from nep.backends.ros2.message_types import MessageTypes
from nep.backends.ros2.names import dds_type, encode_user_data
from nep.backends.ros_types.rosbags_fields import RosField

_MAX_BLOCKING_NS = 100_000_000
_IDL_NAMES = {"byte": "uint8"}


class DdsTopics:
    """DDS topics of one participant, by name and type. Guarded by the participant's lock."""

    def __init__(self, library: Dds, types: MessageTypes, entity: Any) -> None:  # noqa: ANN401 - see `Dds`
        self._dds = library
        self._types = types
        self._entity = entity
        self._classes: dict[str, Any] = {}
        self._topics: dict[tuple[str, str], Any] = {}

    def topic(self, name: str, ros_type: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        """Return a DDS topic whose samples are the CDR of a ROS type; create it if needed."""
        key = (name, ros_type)
        if key not in self._topics:
            self._topics[key] = self._dds.topic.Topic(self._entity, name, self.sample_class(ros_type))
        return self._topics[key]

    def service_topic(self, name: str, ros_type: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        """Return the DDS topic for a service's requests or responses; create it if needed."""
        key = (name, ros_type)
        if key not in self._topics:
            self._topics[key] = self._dds.topic.Topic(self._entity, name, self.service_class(ros_type))
        return self._topics[key]

    def create_state_writer(self, name: str, ros_type: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        """Create a writer whose last sample is also delivered to late readers."""
        policies = self._dds.qos.Policy
        history_policy = policies.History.KeepLast(1)
        history = (history_policy, policies.DurabilityService(0, history_policy, -1, -1, -1))
        return self._dds.pub.DataWriter(
            self._entity, self.topic(name, ros_type), self._state_qos(ros_type, *history)
        )

    def create_state_reader(self, name: str, ros_type: str) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        """Create a reader that receives the last sample of each writer created by `create_state_writer`."""
        history = self._dds.qos.Policy.History.KeepLast(1000)
        return self._dds.sub.DataReader(
            self._entity, self.topic(name, ros_type), self._state_qos(ros_type, history)
        )

    def _state_qos(self, ros_type: str, *history: Any) -> Any:  # noqa: ANN401 - cyclonedds is not typed
        policies = self._dds.qos.Policy
        return self._dds.qos.Qos(
            policies.Reliability.Reliable(_MAX_BLOCKING_NS),
            policies.Durability.TransientLocal,
            policies.DataRepresentation(use_cdrv0_representation=True),
            policies.Userdata(encode_user_data({"typehash": self._types.type_hash(ros_type)})),
            *history,
        )

    def service_class(self, ros_type: str) -> Any:  # noqa: ANN401 - created dynamically
        """Return the sample class of a service's requests or responses, as in rmw_cyclonedds.

        The client's id and the number of the call precede the fields.
        """
        idl_types = self._dds.idl.types
        return self._create_class(ros_type, {"guid": idl_types.uint64, "sequence_number": idl_types.int64})

    def sample_class(self, ros_type: str) -> Any:  # noqa: ANN401 - created dynamically
        """Return the sample class of a ROS type."""
        return self._create_class(ros_type, {})

    def _create_class(self, ros_type: str, base_members: dict[str, Any]) -> Any:  # noqa: ANN401 - created dynamically
        if ros_type not in self._classes:
            members = base_members | {
                each.name: self._member_type(each) for each in self._types.fields(ros_type)
            }
            sample_class = self._dds.idl.make_idl_struct(
                ros_type.rpartition("/")[2], dds_type(ros_type), members
            )
            sample_class.serialize = _serialize
            sample_class.deserialize = classmethod(_deserialize)
            self._classes[ros_type] = sample_class
        return self._classes[ros_type]

    def _member_type(self, field: RosField) -> Any:  # noqa: ANN401 - a type
        idl_types = self._dds.idl.types
        if field.is_message:
            item = self.sample_class(field.kind)
        elif field.kind == "bool":
            item = bool
        elif field.kind == "string":
            item = idl_types.bounded_str[field.max_text_bytes] if field.max_text_bytes else str
        else:
            item = getattr(idl_types, _IDL_NAMES.get(field.kind, field.kind))
        if field.length is None:
            return item
        if field.length >= 0:
            return idl_types.array[item, field.length]
        return idl_types.sequence[item, field.size] if field.size else idl_types.sequence[item]

    def clear(self) -> None:
        """Release all topics. Called when the participant is closed."""
        self._topics.clear()


def create_sample(sample_class: Any, cdr: bytes) -> Any:  # noqa: ANN401 - created dynamically
    """Return a sample of class `sample_class` with the content `cdr`."""
    sample = sample_class.__new__(sample_class)
    sample.cdr = cdr
    return sample


def _serialize(sample: Any, *_arguments: object, **_options: object) -> bytes:  # noqa: ANN401 - see above
    return bytes(sample.cdr)


def _deserialize(sample_class: Any, /, cdr: bytes, *_arguments: object, **_options: object) -> Any:  # noqa: ANN401
    return create_sample(sample_class, cdr)
