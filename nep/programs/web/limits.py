"""Resource limits for one page of `nep web`. All are checked before memory is allocated."""

MAX_PAGES = 100
MAX_MESSAGE_BYTES = 8 * 2**20
"""Maximum size of an incoming WebSocket message, and of an operation reassembled from fragments."""
MAX_VALUES = 1_000_000
"""Maximum number of values in an incoming operation; parsed, `[[],[],…]` takes 30 times its bytes."""
MAX_NAME_LENGTH = 256
MAX_TOPICS = 200
"""Maximum number of topics that a page publishes, and that it subscribes to."""
MAX_SUBSCRIPTION_IDS = 100
"""Maximum number of subscriptions of a page to one topic."""
MAX_SERVICES = 100
"""Maximum number of services that a page serves, and that it calls."""
MAX_CALLS = 500
"""Maximum number of calls in flight that a page has made, and that it has to reply to."""
CALL_TIMEOUT_S = 10.0
MAX_CALL_TIMEOUT_S = 3_600.0
MAX_FRAGMENTED = 16
"""Maximum number of incomplete operations of a page."""
MAX_FRAGMENTS = 10_000
"""Maximum number of fragments of one operation."""
MIN_FRAGMENT_SIZE = 128
"""Minimum size of outgoing fragments in characters; smaller ones would consist mostly of the envelope."""
MAX_NESTED_OPERATIONS = 3
"""Maximum nesting of operations; a fragmented PNG wraps an operation twice."""
MAX_QUEUED_MESSAGES = 1_000
"""Maximum queue length for one topic if the page doesn't set a limit."""
MAX_QUEUED_BYTES = 32 * 2**20
"""Maximum size of a page's queued messages of all topics together."""
MAX_CONTROL_BYTES = 16 * 2**20
"""Maximum size of queued replies, calls and statuses. They can't be dropped: beyond, the page is closed."""
AUTH_TIMEOUT_S = 10.0
