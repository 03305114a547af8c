using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Security handshake of one connection, between the greeting and the first message.</summary>
    /// <remarks>
    /// A connection asks <see cref="NextCommand"/> until it returns null, then passes what the peer sends to
    /// <see cref="Receive"/>, until <see cref="IsReady"/>. <see cref="NullMechanism"/> is the only one so far.
    /// </remarks>
    internal interface IMechanism
    {
        /// <summary>Name in the greeting, at most 20 ASCII characters.</summary>
        string Name { get; }

        /// <summary>Whether both sides may send messages now.</summary>
        bool IsReady { get; }

        /// <summary>Properties that the peer sent, such as <c>Socket-Type</c>.</summary>
        IDictionary<string, byte[]> PeerProperties { get; }

        /// <summary>Body of the next command to send, or null when it is the peer's turn.</summary>
        byte[] NextCommand();

        /// <summary>Take a command of the peer.</summary>
        /// <exception cref="ZmtpException">It is not allowed here.</exception>
        void Receive(byte[] command);
    }

    /// <summary>Makes the mechanism of each new connection.</summary>
    internal delegate IMechanism MechanismFactory(string socketType, bool isServer);
}
