namespace Nep.Zmtp
{
    /// <summary>Bounds of one socket: sizes in bytes, times in milliseconds.</summary>
    internal sealed class ZmtpLimits
    {
        /// <summary>Largest incoming message, all parts together.</summary>
        public long MaxMessageBytes = 1L << 30;

        /// <summary>Most parts of an incoming message.</summary>
        public int MaxParts = 16;

        /// <summary>Largest incoming command (READY, PING, ...).</summary>
        public int MaxCommandBytes = 4096;

        /// <summary>Most messages queued for one connection; further ones are dropped and counted.</summary>
        public int MaxQueuedMessages = 50000;

        /// <summary>Most bytes queued for one connection; one larger message passes when little is queued.</summary>
        public long MaxQueuedBytes = 192L << 20;

        /// <summary>A message of any size may be queued while no more bytes than this wait.</summary>
        public long AlwaysQueueBelowBytes = 12L << 20;

        /// <summary>Most incoming connections of a bound socket.</summary>
        public int MaxConnections = 10000;

        /// <summary>Most connections of a bound socket that are still in their handshake.</summary>
        public int MaxPendingHandshakes = 256;

        /// <summary>Most subscriptions of one connection.</summary>
        public int MaxSubscriptions = 10000;

        public int HandshakeTimeoutMs = 10000;
        public int ConnectTimeoutMs = 3000;
        public int MinReconnectMs = 50;
        public int MaxReconnectMs = 1000;

        /// <summary>Interval of PING on connections to other computers; 0 sends none.</summary>
        public int HeartbeatMs = 5000;

        /// <summary>Whether peers on this computer are sent PING, too: for tests.</summary>
        public bool IsHeartbeatLocal = false;

        /// <summary>A peer on another computer that is silent for longer is disconnected.</summary>
        public int HeartbeatTimeoutMs = 15000;
    }
}
