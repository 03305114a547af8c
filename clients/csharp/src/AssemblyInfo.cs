using System.Runtime.CompilerServices;

[assembly: Nep.Preserve]
[assembly: InternalsVisibleTo("WirePeer")]
[assembly: InternalsVisibleTo("ZmtpPeer")]
[assembly: InternalsVisibleTo("Nep.Unity")]
