"""Formatting of the damage of a recording as text."""

from __future__ import annotations

from collections.abc import Sequence

from nep.i18n import _, ngettext, number
from nep.recordings.formats.index import CorruptRange

_MAX_RANGES_LISTED = 3


def corruption_text(damage: Sequence[CorruptRange], start_ns: int) -> str:
    """Format the number of skipped places, their times and the missing messages, without full stop.

    Args:
        damage: Damage to describe.
        start_ns: Start of the recording in ns since 1970, from which times are counted; 0 to count from
            the first damage.

    Returns:
        The text; "" if there is no damage.
    """
    if not damage:
        return ""
    counts = [each.message_count for each in damage]
    start_ns = start_ns or damage[0].start_ns
    ranges_text = "; ".join(_format_range(each, start_ns) for each in damage[:_MAX_RANGES_LISTED])
    if len(damage) > _MAX_RANGES_LISTED:
        ranges_text += "; …"
    summary = ngettext(
        "{count} part of the file is damaged and was skipped ({places})",
        "{count} parts of the file are damaged and were skipped ({places})",
        len(damage),
    ).format(count=len(damage), places=ranges_text)
    if any(each is None for each in counts):
        return _("{damage}; the number of missing messages is unknown").format(damage=summary)
    missing = sum(each or 0 for each in counts)
    return ngettext(
        "{damage}; {count} message is missing", "{damage}; {count} messages are missing", missing
    ).format(damage=summary, count=missing)


def _format_range(corrupt_range: CorruptRange, start_ns: int) -> str:
    if not corrupt_range.end_ns:
        return _("{size} bytes at byte {offset}").format(
            size=corrupt_range.length, offset=corrupt_range.offset
        )
    begin, end = ((at_ns - start_ns) / 1e9 for at_ns in (corrupt_range.start_ns, corrupt_range.end_ns))
    return _("{begin} s to {end} s").format(begin=number(begin, ".1f"), end=number(end, ".1f"))
