"""Limits of `nep web`: what one page may take of the computer, all of them checked before memory is taken."""

__all__ = [
    "AUTH_TIMEOUT_S",
    "CALL_TIMEOUT_S",
    "MAX_CALLS",
    "MAX_CALL_TIMEOUT_S",
    "MAX_CONTROL_BYTES",
    "MAX_FRAGMENTED",
    "MAX_FRAGMENTS",
    "MAX_MESSAGE_BYTES",
    "MAX_NAME_LENGTH",
    "MAX_NESTED_OPERATIONS",
    "MAX_PAGES",
    "MAX_QUEUED_BYTES",
    "MAX_QUEUED_MESSAGES",
    "MAX_SERVICES",
    "MAX_SUBSCRIPTION_IDS",
    "MAX_TOPICS",
    "MAX_VALUES",
    "MIN_FRAGMENT_SIZE",
]

MAX_PAGES = 100
MAX_MESSAGE_BYTES = 8 * 2**20
"""Of one incoming WebSocket message, and of an operation that is put together from fragments."""
MAX_VALUES = 1_000_000
"""Values in one incoming operation: `[[],[],…]` takes 30 times its bytes once it is parsed."""
MAX_NAME_LENGTH = 256
MAX_TOPICS = 200
"""Topics that a page publishes, and as many again that it subscribes to."""
MAX_SUBSCRIPTION_IDS = 100
"""Subscriptions of one page to one topic."""
MAX_SERVICES = 100
"""Services that a page serves, and as many again that it calls."""
MAX_CALLS = 500
"""Calls of a page that are in flight, and as many again that it has to answer."""
CALL_TIMEOUT_S = 10.0
MAX_CALL_TIMEOUT_S = 3_600.0
MAX_FRAGMENTED = 16
"""Incomplete operations of a page."""
MAX_FRAGMENTS = 10_000
"""Fragments of one operation."""
MIN_FRAGMENT_SIZE = 128
"""Smaller fragments would be mostly envelope."""
MAX_NESTED_OPERATIONS = 3
"""A fragmented PNG is two operations around the third."""
MAX_QUEUED_MESSAGES = 1_000
"""Messages of one topic that wait for a page which doesn't say how many."""
MAX_QUEUED_BYTES = 32 * 2**20
"""Messages of all topics that wait for a page."""
MAX_CONTROL_BYTES = 16 * 2**20
"""Answers, calls and statuses that wait for a page; none of them can be dropped, so it is closed."""
AUTH_TIMEOUT_S = 10.0
