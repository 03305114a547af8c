"""ROS service types: the installed types, and `nep_msgs/Call` for calls between nep nodes."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from nep.backends.ros.library import service_definition
from nep.backends.ros.type_mapping import is_ros_type, not_installed_error
from nep.backends.ros_types.carriers import is_call_type
from nep.backends.ros_types.definition import parse
from nep.backends.ros_types.typed_services import CALL_REQUEST, CALL_RESPONSE, TypedService
from nep.errors import NepError
from nep.i18n import _

_types: dict[str, ServiceType] = {}


@dataclass(frozen=True)
class ServiceType(TypedService):
    """Service type with the MD5 sum of its definition."""

    md5sum: str = ""


NEP_CALL = ServiceType(
    "nep_msgs/Call",
    parse("nep_msgs/CallRequest", CALL_REQUEST),
    parse("nep_msgs/CallResponse", CALL_RESPONSE),
    is_nep=True,
    md5sum=hashlib.md5(
        (CALL_REQUEST + CALL_RESPONSE).encode(), usedforsecurity=False
    ).hexdigest(),  # as in ROS
)


def installed_service(name: str) -> ServiceType:
    """Return an installed service type, or `nep_msgs/Call`.

    Raises `NepError`, whose message names the package to install.
    """
    if name == NEP_CALL.name:
        return NEP_CALL
    if name not in _types:
        definition = service_definition(name)
        if definition is None:
            raise not_installed_error(name, _("ROS service"))
        request = parse(f"{name}Request", definition.request)
        _types[name] = ServiceType(
            name, request, parse(f"{name}Response", definition.response), md5sum=definition.md5sum
        )
    return _types[name]


def service_type_for(msg_type: str) -> ServiceType:
    """Return the ROS service type for the `msg_type` of a server.

    "json" and "msgpack" select `nep_msgs/Call`. Raises `NepError` for a ROS type that isn't installed,
    and for all other types.
    """
    if is_ros_type(msg_type):
        return installed_service(msg_type)
    if not is_call_type(msg_type):
        raise NepError(
            _("a ROS service can't have the type '{name}'; use a type such as 'std_srvs/SetBool'").format(
                name=msg_type
            )
        )
    return NEP_CALL
