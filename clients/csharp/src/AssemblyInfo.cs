using System.Runtime.CompilerServices;

[assembly: InternalsVisibleTo("WirePeer")]
[assembly: InternalsVisibleTo("ZmtpPeer")]
[assembly: InternalsVisibleTo("Nep.Unity")]
