using System.Runtime.CompilerServices;

[assembly: InternalsVisibleTo("Nep.Tests")]
[assembly: InternalsVisibleTo("ZmtpPeer")]
