using System;

namespace Nep.Zmtp
{
    /// <summary>The peer broke the protocol or a limit; its connection is closed and counted under <see cref="Code"/>.</summary>
    internal sealed class ZmtpException : Exception
    {
        public ZmtpException(string code, string message) : base(message)
        {
            Code = code;
        }

        /// <summary>Short name of the reason, such as <c>frame-too-large</c>.</summary>
        public string Code { get; private set; }
    }

    /// <summary>The connection ended: closed by the peer, by the network or by this side.</summary>
    internal sealed class ConnectionClosedException : Exception
    {
        public ConnectionClosedException(string message) : base(message)
        {
        }
    }
}
