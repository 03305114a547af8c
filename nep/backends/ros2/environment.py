"""Settings from environment variables: domain, release, discovery range, Cyclone DDS configuration."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from html import escape
from typing import Literal

from nep.errors import NepError, WrongTypeError
from nep.i18n import _

_DOMAIN_COUNT = 233
"""Number of valid DDS domains; higher domain ids have no valid ports."""
_SUBNET_RANGES = frozenset({"SUBNET", "SYSTEM_DEFAULT"})
_VALID_RANGES = frozenset({"", "OFF", "LOCALHOST", *_SUBNET_RANGES})
MAX_PARTICIPANTS = 100
"""Maximum number of participants per computer in a domain.

Without multicast, the ports of this number of participants are probed.
"""
_MAX_PARTICIPANT_INDEX = MAX_PARTICIPANTS - 1
_PACKET_SIZES = "<MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"
"""Packet sizes in the configuration of Cyclone DDS.

With large packets, 8 MB are sent in a seventh of the time that the defaults take.
"""
_INTERNAL_SETTINGS = (
    "<Internal><Watermarks><WhcHigh>64MB</WhcHigh></Watermarks>"
    "<WriterLingerDuration>0s</WriterLingerDuration></Internal>"
)
"""Internal settings in the configuration of Cyclone DDS.

Publishing blocks at 64 MB of unacknowledged data. Closing a writer doesn't linger, because nep itself
waits for acknowledgements before closing.
"""


def resolve_domain(master: str | None, environment: Mapping[str, str] = os.environ) -> str:
    """Return the DDS domain of a node: `master`, else $ROS_DOMAIN_ID, else "0".

    Raises `NepError` for an invalid domain.
    """
    if master is not None and not isinstance(master, str):
        raise WrongTypeError(
            _("a ROS 2 domain must be a 'str' such as '5', not a '{kind}'").format(kind=type(master).__name__)
        )
    domain = (master or "").strip()
    if domain and not _is_valid_domain(domain):
        raise NepError(
            _("'{said}' isn't a ROS 2 domain; use a number from 0 to {most}").format(
                said=domain[:40], most=_DOMAIN_COUNT - 1
            )
        )
    domain = domain or environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not _is_valid_domain(domain):
        raise NepError(
            _("ROS_DOMAIN_ID is '{said}'; set it to a number from 0 to {most}").format(
                said=domain[:40], most=_DOMAIN_COUNT - 1
            )
        )
    return str(int(domain))


def _is_valid_domain(domain: str) -> bool:
    return domain.isascii() and domain.isdigit() and len(domain) <= 3 and int(domain) < _DOMAIN_COUNT


def distribution(environment: Mapping[str, str]) -> str:
    """Return the ROS 2 release in lower case: $ROS_DISTRO, or "jazzy"."""
    return environment.get("ROS_DISTRO", "").strip().lower() or "jazzy"


def _configured_range(environment: Mapping[str, str]) -> str:
    value = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper()
    if value not in _VALID_RANGES:
        raise NepError(
            _("ROS_AUTOMATIC_DISCOVERY_RANGE is '{said}'; set it to SUBNET, LOCALHOST or OFF").format(
                said=value[:40]
            )
        )
    return value


def _discovery_range(environment: Mapping[str, str]) -> Literal["nobody", "computer", "peers", "subnet"]:
    # Returns the discovery range. Raises `NepError`.
    local = environment.get("ROS_LOCALHOST_ONLY", "").strip()
    configured_range = _configured_range(environment)
    if configured_range == "OFF":
        return "nobody"
    if local == "1":
        return "computer"
    if local == "0" or configured_range in _SUBNET_RANGES:
        return "subnet"
    return "peers" if _peers(environment) else "computer"


def _peers(environment: Mapping[str, str]) -> list[str]:
    return [each.strip() for each in environment.get("ROS_STATIC_PEERS", "").split(";") if each.strip()]


def is_loopback_only(environment: Mapping[str, str]) -> bool:
    """Return True if only programs of this computer are discovered, which is the default."""
    return _discovery_range(environment) in {"nobody", "computer"}


def cyclonedds_config(environment: Mapping[str, str]) -> str | None:
    """Return the XML configuration for Cyclone DDS, or None if $CYCLONEDDS_URI already sets one."""
    if environment.get("CYCLONEDDS_URI"):
        return None
    discovery_range = _discovery_range(environment)
    peers = {
        "nobody": [],
        "computer": ["127.0.0.1"],
        "peers": [*_peers(environment), "127.0.0.1"],
        "subnet": _peers(environment),
    }[discovery_range]
    interface = '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
    has_multicast = discovery_range in {"computer", "subnet"}
    peer_elements = "".join(f'<Peer Address="{escape(each)}"/>' for each in peers)
    return (
        f'<CycloneDDS><Domain Id="any"><General>{interface if is_loopback_only(environment) else ""}'
        f"<AllowMulticast>{'default' if has_multicast else 'false'}</AllowMulticast>{_PACKET_SIZES}</General>"
        f"<Discovery>{f'<Tag>nobody-{secrets.token_hex(8)}</Tag>' if discovery_range == 'nobody' else ''}"
        f"<ParticipantIndex>auto</ParticipantIndex>"
        f"<MaxAutoParticipantIndex>{_MAX_PARTICIPANT_INDEX}</MaxAutoParticipantIndex>"
        f"{f'<Peers>{peer_elements}</Peers>' if peer_elements else ''}"
        f"</Discovery>{_INTERNAL_SETTINGS}</Domain></CycloneDDS>"
    )
