"""Services: a client calls, a server answers; a surveyor asks all respondents."""

from nep.services.client import Client as Client
from nep.services.server import Server as Server
from nep.services.survey import Respondent as Respondent
from nep.services.survey import Surveyor as Surveyor

__all__ = ["Client", "Respondent", "Server", "Surveyor"]
