"""Fuzz targets of all parsers of external input."""

from __future__ import annotations

from collections.abc import Mapping

from tests.fuzz import of_app, of_command_line, of_gateway, of_messages, of_other_back_ends, of_web, of_wire
from tests.fuzz.target import Target

TARGETS: Mapping[str, Target] = {
    name: target
    for module in (of_wire, of_messages, of_gateway, of_other_back_ends, of_command_line, of_web, of_app)
    for name, target in module.TARGETS.known.items()
}
