"""Services (a client calls, a server replies) and surveys (a surveyor asks all respondents)."""

from nep.patterns.services.client import Client as Client
from nep.patterns.services.server import Server as Server
from nep.patterns.services.survey import Respondent as Respondent
from nep.patterns.services.survey import Surveyor as Surveyor

__all__ = ["Client", "Respondent", "Server", "Surveyor"]
