"""Arguments as callers give them. Services check theirs, too: see `nep.arguments`."""

from nep.arguments import at_least as at_least
from nep.arguments import flag as flag
from nep.arguments import function as function
from nep.arguments import limit as limit
from nep.arguments import one_of as one_of
from nep.arguments import period as period
from nep.arguments import seconds as seconds
from nep.arguments import text as text
from nep.arguments import within as within

__all__ = ["at_least", "flag", "function", "limit", "one_of", "period", "seconds", "text", "within"]
