"""ROS 2 service types: common types, and types of .srv files.

`nep_msgs/srv/Call` is the type for calls between nep nodes, see `nep.backends.ros_types.typed_services`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nep.backends.ros2.message_types import FOLDERS_VARIABLE, MessageTypes
from nep.backends.ros2.names import service_type_name
from nep.backends.ros_types.carriers import is_call_type
from nep.backends.ros_types.typed_services import CALL_REQUEST, CALL_RESPONSE, TypedService
from nep.errors import NepError, WireError, did_you_mean
from nep.i18n import _
from nep.messages import codecs
from nep.messages.codecs import CODECS, Codec

NEP_CALL = "nep_msgs/srv/Call"
_SUCCESS_FIELDS = "bool success\nstring message"
_COMMON_TYPES = {
    NEP_CALL: (CALL_REQUEST, CALL_RESPONSE),
    "std_srvs/srv/Empty": ("", ""),
    "std_srvs/srv/SetBool": ("bool data", _SUCCESS_FIELDS),
    "std_srvs/srv/Trigger": ("", _SUCCESS_FIELDS),
    "example_interfaces/srv/AddTwoInts": ("int64 a\nint64 b", "int64 sum"),
    "example_interfaces/srv/SetBool": ("bool data", _SUCCESS_FIELDS),
    "example_interfaces/srv/Trigger": ("", _SUCCESS_FIELDS),
    "nav_msgs/srv/GetMap": ("", "nav_msgs/OccupancyGrid map"),
    "sensor_msgs/srv/SetCameraInfo": (
        "sensor_msgs/CameraInfo camera_info",
        "bool success\nstring status_message",
    ),
    "rcl_interfaces/srv/GetParameters": ("string[] names", "ParameterValue[] values"),
    "rcl_interfaces/srv/SetParameters": ("Parameter[] parameters", "SetParametersResult[] results"),
    "rcl_interfaces/srv/ListParameters": ("string[] prefixes\nuint64 depth", "ListParametersResult result"),
    "rcl_interfaces/srv/DescribeParameters": ("string[] names", "ParameterDescriptor[] descriptors"),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
}
_MAX_FILE_BYTES = 2**20


def request_type_of(service_type: str) -> str:
    """Return the name of a service type's request type."""
    return f"{service_type}_Request"


def response_type_of(service_type: str) -> str:
    """Return the name of a service type's response type."""
    return f"{service_type}_Response"


@dataclass(frozen=True)
class _BodyCodec:
    # Codec of a request or response in CDR.
    types: MessageTypes
    name: str

    def encode(self, payload: Any) -> bytes:  # noqa: ANN401 - any payload
        return self.types.encode(self.name, payload)

    def decode(self, data: bytes) -> dict[str, Any]:
        decoded = self.types.decode(self.name, data)
        if not isinstance(decoded, dict):
            raise WireError(_("not a ROS message"), len(data))
        return decoded


def find_service_type(types: MessageTypes, name: str) -> TypedService:
    """Return a service type by its full name.

    Raises `NepError` if the type is unknown or its definition is invalid.
    """
    texts = _COMMON_TYPES.get(name) or _find_definition(name)
    if texts is None:
        raise NepError(
            _(
                "unknown service type '{name}'; {did_you_mean} (or set {variable} to a folder of .srv files)"
            ).format(
                name=name,
                did_you_mean=did_you_mean(name, tuple(each for each in _COMMON_TYPES if each != NEP_CALL)),
                variable=FOLDERS_VARIABLE,
            )
        )
    types.add_service_part(request_type_of(name), texts[0])
    types.add_service_part(response_type_of(name), texts[1])
    return TypedService(
        name,
        _BodyCodec(types, request_type_of(name)),
        _BodyCodec(types, response_type_of(name)),
        is_nep=name == NEP_CALL,
    )


def _find_definition(name: str) -> tuple[str, str] | None:
    # Returns the parts of the .srv file before and after its separator.
    package, _srv, type_name = name.split("/")
    for folder in filter(None, os.environ.get(FOLDERS_VARIABLE, "").split(os.pathsep)):
        for path in sorted(Path(folder).rglob(f"{type_name}.srv")):
            file_package = path.parent.parent.name if path.parent.name == "srv" else path.parent.name
            if file_package != package:
                continue
            if path.stat().st_size > _MAX_FILE_BYTES:
                raise NepError(
                    _("'{path}' is too large; choose a folder with .srv files only").format(path=path)
                )
            lines = path.read_text(encoding="utf-8").splitlines()
            separator_lines = [index for index, line in enumerate(lines) if line.strip() == "---"]
            if len(separator_lines) != 1:
                raise NepError(
                    _(
                        "'{path}' isn't a valid .srv file; write one line '---' between the request and "
                        "the response"
                    ).format(path=path)
                )
            return "\n".join(lines[: separator_lines[0]]), "\n".join(lines[separator_lines[0] + 1 :])
    return None


def service_type_for(types: MessageTypes, msg_type: str) -> TypedService:
    """Return the ROS service type for the `msg_type` of a server or client.

    "json" and "msgpack" select `nep_msgs/srv/Call`. Raises `NepError` for an unknown ROS type, and for
    all other types.
    """
    name = service_type_name(msg_type)
    if name is not None:
        return find_service_type(types, name)
    if not is_call_type(msg_type):
        raise NepError(
            _(
                "a ROS 2 service can't have the type '{name}'; use a type such as 'std_srvs/srv/SetBool'"
            ).format(name=msg_type)
        )
    return find_service_type(types, NEP_CALL)


def call_codec_for(msg_type: str) -> Codec:
    """Return the codec for a client's calls. ROS types use msgpack, which supports bytes and NaN."""
    return CODECS["msgpack"] if service_type_name(msg_type) is not None else codecs.codec_for(msg_type)
