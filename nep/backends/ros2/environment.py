"""What the environment says: the domain, the release, who may be found; and Cyclone DDS's settings."""

from __future__ import annotations

import os
from collections.abc import Mapping
from html import escape

from nep.errors import NepError, WrongTypeError
from nep.i18n import _

__all__ = ["configuration", "distribution", "domain", "is_loopback_only"]

_DOMAINS = 233
"""Ports of larger domains do not exist."""
_EVERYWHERE = frozenset({"SUBNET", "SYSTEM_DEFAULT"})
_RANGES = frozenset({"", "OFF", "LOCALHOST", *_EVERYWHERE})
_PARTICIPANTS = 32
"""So many programs of a computer are looked for where multicast does not work."""
_SIZES = "<MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"
"""Large messages need few packets, 8 MB a seventh of the time."""
_ROOM = "<Internal><Watermarks><WhcHigh>64MB</WhcHigh></Watermarks></Internal>"
"""So much is on its way before publishing waits."""


def domain(master: str | None, environment: Mapping[str, str] = os.environ) -> str:
    """The domain that a node is given as its `master`, else ROS_DOMAIN_ID, else "0". Raises `NepError`."""
    if master is not None and not isinstance(master, str):
        raise WrongTypeError(
            _("a domain of ROS 2 is a 'str' such as '5', not a '{kind}'").format(kind=type(master).__name__)
        )
    said = (master or "").strip()
    if said and not _is_domain(said):
        raise NepError(
            _("'{said}' is no domain of ROS 2; use a number from 0 to {most}").format(
                said=said[:40], most=_DOMAINS - 1
            )
        )
    said = said or environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not _is_domain(said):
        raise NepError(
            _("ROS_DOMAIN_ID is '{said}'; set it to a number from 0 to {most}").format(
                said=said[:40], most=_DOMAINS - 1
            )
        )
    return str(int(said))


def _is_domain(said: str) -> bool:
    return said.isascii() and said.isdigit() and len(said) <= 3 and int(said) < _DOMAINS


def distribution(environment: Mapping[str, str]) -> str:
    """The release whose messages are spoken, in small letters: ROS_DISTRO, else "jazzy"."""
    return environment.get("ROS_DISTRO", "").strip().lower() or "jazzy"


def _range(environment: Mapping[str, str]) -> str:
    said = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper()
    if said not in _RANGES:
        raise NepError(
            _("ROS_AUTOMATIC_DISCOVERY_RANGE is '{said}'; use SUBNET, LOCALHOST or OFF").format(
                said=said[:40]
            )
        )
    return said


def is_loopback_only(environment: Mapping[str, str]) -> bool:
    """Whether only programs of this computer are met. So it is unless it is said otherwise."""
    local = environment.get("ROS_LOCALHOST_ONLY", "").strip()
    if local == "1":
        return True
    return local != "0" and _range(environment) not in _EVERYWHERE


def configuration(environment: Mapping[str, str]) -> str | None:
    """Settings for Cyclone DDS as XML; None when CYCLONEDDS_URI has the user's own."""
    if environment.get("CYCLONEDDS_URI"):
        return None
    is_off = _range(environment) == "OFF"
    peers = [each for each in environment.get("ROS_STATIC_PEERS", "").split(";") if each.strip()]
    interface = ""
    if is_loopback_only(environment):
        interface = (
            '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
            f"<AllowMulticast>{'false' if is_off else 'true'}</AllowMulticast>"
        )
        peers = [*peers, *([] if is_off else ["127.0.0.1"])]
    listed = "".join(f'<Peer Address="{escape(each.strip())}"/>' for each in peers)
    return (
        f'<CycloneDDS><Domain Id="any"><General>{interface}{_SIZES}</General>'
        f"<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        f"<MaxAutoParticipantIndex>{_PARTICIPANTS}</MaxAutoParticipantIndex>"
        f"{f'<Peers>{listed}</Peers>' if listed else ''}</Discovery>{_ROOM}</Domain></CycloneDDS>"
    )
