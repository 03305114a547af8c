using System;

namespace Nep.Zmtp
{
    /// <summary>Violation of the protocol or a limit by the peer; the connection is closed and counted under <see cref="Code"/>.</summary>
    internal sealed class ZmtpException : Exception
    {
        public ZmtpException(string code, string message) : base(message)
        {
            Code = code;
        }

        /// <summary>Code of the reason, such as <c>message-too-large</c>.</summary>
        public string Code { get; private set; }
    }

    /// <summary>End of a connection: closed by the peer, by the network or by this side.</summary>
    internal sealed class ConnectionClosedException : Exception
    {
        public ConnectionClosedException(string message) : base(message)
        {
        }
    }
}
