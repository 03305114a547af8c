"""Services: a client calls, a server answers."""

from nep.services.client import Client as Client
from nep.services.server import Server as Server

__all__ = ["Client", "Server"]
