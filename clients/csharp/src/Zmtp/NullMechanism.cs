using System;
using System.Collections.Generic;
using System.Text;

namespace Nep.Zmtp
{
    /// <summary>Mechanism NULL: one READY command in each direction.</summary>
    internal sealed class NullMechanism : IMechanism
    {
        private readonly string _socketType;
        private bool _hasSent;
        private bool _hasReceived;

        public NullMechanism(string socketType)
        {
            _socketType = socketType;
            PeerProperties = new Dictionary<string, byte[]>(StringComparer.OrdinalIgnoreCase);
        }

        public string Name
        {
            get { return "NULL"; }
        }

        public bool IsReady
        {
            get { return _hasSent && _hasReceived; }
        }

        public IDictionary<string, byte[]> PeerProperties { get; private set; }

        public static IMechanism Create(string socketType, bool isServer)
        {
            return new NullMechanism(socketType);
        }

        public byte[] NextCommand()
        {
            if (_hasSent)
            {
                return null;
            }
            _hasSent = true;
            byte[] type = Encoding.ASCII.GetBytes(_socketType);
            byte[] name = Encoding.ASCII.GetBytes("Socket-Type");
            var body = new List<byte>();
            body.AddRange(Commands.Name("READY"));
            body.Add((byte)name.Length);
            body.AddRange(name);
            body.AddRange(new byte[] { 0, 0, 0, (byte)type.Length });
            body.AddRange(type);
            return body.ToArray();
        }

        public void Receive(byte[] command)
        {
            if (Commands.Is(command, "ERROR"))
            {
                throw new ZmtpException("refused-by-peer", "it reports an error: " + Commands.ErrorReason(command));
            }
            if (!Commands.Is(command, "READY") || _hasReceived)
            {
                throw new ZmtpException("bad-handshake", "it sent a malformed handshake");
            }
            Commands.ReadProperties(command, 6, PeerProperties);
            _hasReceived = true;
        }
    }
}
