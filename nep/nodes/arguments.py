"""Argument validation for nodes; see `nep.system.arguments`."""

from nep.system.arguments import check_at_least as check_at_least
from nep.system.arguments import check_bool as check_bool
from nep.system.arguments import check_choice as check_choice
from nep.system.arguments import check_function as check_function
from nep.system.arguments import check_optional_time_limit as check_optional_time_limit
from nep.system.arguments import check_period as check_period
from nep.system.arguments import check_range as check_range
from nep.system.arguments import check_time_limit as check_time_limit
from nep.system.arguments import check_type_name as check_type_name

__all__ = [
    "check_at_least",
    "check_bool",
    "check_choice",
    "check_function",
    "check_optional_time_limit",
    "check_period",
    "check_range",
    "check_time_limit",
    "check_type_name",
]
