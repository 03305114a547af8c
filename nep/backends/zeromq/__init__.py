"""The back end `zeromq`: the native wire, and direct connections in the original one.

Its publishers, subscribers and sockets, the thread that serves them, and the session with the master.
"""

from nep.backends.zeromq.backend import BACKEND as BACKEND
