"""Resource limits of `nep web`: number of pages, and limits of each page.

All limits are checked before memory is allocated.
"""

MAX_PAGES = 100
MAX_MESSAGE_BYTES = 8 * 2**20
"""Maximum size in bytes of an incoming WebSocket message, and of an operation joined from fragments."""
MAX_VALUES = 1_000_000
"""Maximum number of values in an incoming operation.

Parsed values need much memory: `[[],[],…]` takes 30 times its size.
"""
MAX_NAME_LENGTH = 256
MAX_TOPICS = 200
"""Maximum number of topics that a page publishes; also the maximum number that it subscribes to."""
MAX_SUBSCRIPTION_IDS = 100
"""Maximum number of subscriptions of a page to one topic."""
MAX_SERVICES = 100
"""Maximum number of services that a page serves; also the maximum number that it calls."""
MAX_CALLS = 500
"""Maximum number of calls in flight that a page made; also the maximum number that it must reply to."""
CALL_TIMEOUT_S = 10.0
MAX_CALL_TIMEOUT_S = 3_600.0
MAX_FRAGMENTED_OPERATIONS = 16
"""Maximum number of incomplete operations of a page."""
MAX_FRAGMENTS = 10_000
"""Maximum number of fragments of one operation."""
MIN_FRAGMENT_SIZE = 128
"""Minimum size of outgoing fragments in characters, so that the overhead of the envelopes stays small."""
MAX_NESTED_OPERATIONS = 3
"""Maximum nesting of operations. A fragmented PNG wraps an operation twice."""
MAX_QUEUED_MESSAGES = 1_000
"""Maximum number of queued messages of a topic if the page doesn't request a queue length."""
MAX_QUEUED_BYTES = 32 * 2**20
"""Maximum total size in bytes of a page's queued messages."""
MAX_CONTROL_BYTES = 16 * 2**20
"""Maximum size in bytes of queued replies, calls and statuses, which can't be dropped.

A page that exceeds the limit is disconnected.
"""
AUTH_TIMEOUT_S = 10.0
