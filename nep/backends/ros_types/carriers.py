"""Carriers: the ROS messages that contain the data of nep's codecs. `Codec.ros_carrier` selects one.

| carrier | message                     | content of its field `data`                    |
|---------|-----------------------------|------------------------------------------------|
| text    | std_msgs/String             | UTF-8 text without zero bytes, such as JSON    |
| bytes   | std_msgs/UInt8MultiArray    | the bytes; the array has no dimensions         |
| image   | sensor_msgs/CompressedImage | a JPEG or PNG file                             |

Data of a ROS type, published under the name of that type, is a ROS message itself and needs no carrier.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from nep.messages.codecs import CODECS, Codec, RosCarrier, codec_for
from nep.messages.encoded import Encoded

STRING_TYPE: Final = "std_msgs/String"
BYTES_TYPE: Final = "std_msgs/UInt8MultiArray"
COMPRESSED_IMAGE_TYPE: Final = "sensor_msgs/CompressedImage"
RAW_IMAGE_TYPE: Final = "sensor_msgs/Image"
CARRIER_TYPES: Mapping[RosCarrier, str] = {
    "text": STRING_TYPE,
    "bytes": BYTES_TYPE,
    "image": COMPRESSED_IMAGE_TYPE,
}
"""ROS type of each carrier, by its name in ROS 1."""
FOREIGN_CODECS: Mapping[str, str] = {
    STRING_TYPE: "json",
    BYTES_TYPE: "bytes",
    COMPRESSED_IMAGE_TYPE: "image",
    RAW_IMAGE_TYPE: "image",
}
"""Codec that is assumed for the messages of ROS programs, by ROS type."""
_FILE_ENCODINGS = ("jpeg", "png")
_QUEUE_LENGTH = 1000


def carrier_of(msg_type: str) -> RosCarrier:
    """Return the carrier for a message type of nep, which isn't the name of a ROS type."""
    return codec_for(msg_type).ros_carrier or "bytes"


def ros2_name(ros_type: str) -> str:
    """Return the ROS 2 name of a message type, such as "std_msgs/msg/String" for "std_msgs/String"."""
    package, _slash, name = ros_type.rpartition("/")
    return f"{package}/msg/{name}"


def is_call_type(msg_type: str) -> bool:
    """Return True if `msg_type` is a codec for calls between nep nodes over a ROS service, such as "json"."""
    codec = CODECS.get(msg_type)
    return codec is not None and codec.content == "values"


def message_codec(
    name: str,
    number: int,
    encode: Callable[[object], bytes],
    decode: Callable[[bytes | memoryview], object],
    check: Callable[[object], object],
) -> Codec:
    """Return the codec of a ROS type, whose payloads are maps and whose data is the ROS message.

    Args:
        name: Name of the codec.
        number: Number of the codec, which is never sent.
        encode: Encodes a map. Raises `EncodeError`.
        decode: Decodes a message to a map. Raises `DecodeError`.
        check: Raises `EncodeError` for a payload that isn't a map.
    """

    def encode_payload(payload: object) -> Encoded:
        return Encoded(encode(payload))

    def decode_data(data: bytes | memoryview, _extension: Mapping[str, object]) -> object:
        return decode(data)

    return Codec(
        name, number, encode_payload, decode_data, dict, check, queue_length=_QUEUE_LENGTH, ros_carrier=None
    )


def file_encoding(encoded: Encoded) -> str:
    """Return "jpeg" or "png" for an encoded image that is such a file, and "" for raw pixels."""
    encoding = (encoded.extension or {}).get("encoding")
    return str(encoding) if encoding in _FILE_ENCODINGS else ""
