using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Security handshake of one connection, between the greeting and the first message.</summary>
    /// <remarks>
    /// A connection sends the results of <see cref="NextCommand"/> until it returns null, then passes a command of the peer to
    /// <see cref="Receive"/>, and so on until <see cref="IsReady"/>. The only implementation is <see cref="NullMechanism"/>.
    /// </remarks>
    internal interface IMechanism
    {
        /// <summary>Name in the greeting, at most 20 ASCII characters.</summary>
        string Name { get; }

        /// <summary>True once both sides may send messages.</summary>
        bool IsReady { get; }

        /// <summary>Properties that the peer sent, such as <c>Socket-Type</c>.</summary>
        IDictionary<string, byte[]> PeerProperties { get; }

        /// <summary>Return the body of the next command to send, or null to wait for the peer.</summary>
        byte[] NextCommand();

        /// <summary>Handle a command of the peer.</summary>
        /// <exception cref="ZmtpException">The command is malformed or unexpected.</exception>
        void Receive(byte[] command);
    }

    /// <summary>Creates the mechanism of a new connection.</summary>
    internal delegate IMechanism MechanismFactory(string socketType, bool isServer);
}
