"""Argument validation for nodes; see `nep.system.arguments`."""

from nep.system.arguments import at_least as at_least
from nep.system.arguments import flag as flag
from nep.system.arguments import function as function
from nep.system.arguments import limit as limit
from nep.system.arguments import one_of as one_of
from nep.system.arguments import period as period
from nep.system.arguments import seconds as seconds
from nep.system.arguments import text as text
from nep.system.arguments import within as within

__all__ = ["at_least", "flag", "function", "limit", "one_of", "period", "seconds", "text", "within"]
