namespace Nep.Zmtp
{
    /// <summary>Limits of one socket: sizes in bytes, times in milliseconds.</summary>
    internal sealed class ZmtpLimits
    {
        /// <summary>Maximum size of an incoming message with all its parts.</summary>
        public long MaxMessageBytes = 1L << 30;

        /// <summary>Maximum number of parts of an incoming message.</summary>
        public int MaxParts = 16;

        /// <summary>Maximum size of an incoming command (READY, PING, ...).</summary>
        public int MaxCommandBytes = 4096;

        /// <summary>Maximum number of messages queued for one connection; further ones are dropped and counted.</summary>
        public int MaxQueuedMessages = 50000;

        /// <summary>Maximum number of bytes queued for one connection; a larger message is accepted if little is queued.</summary>
        public long MaxQueuedBytes = 192L << 20;

        /// <summary>Number of queued bytes up to which a message of any size may be queued.</summary>
        public long AlwaysQueueBelowBytes = 12L << 20;

        /// <summary>Maximum number of incoming connections of a bound socket.</summary>
        public int MaxConnections = 10000;

        /// <summary>Maximum number of connections of a bound socket in the handshake.</summary>
        public int MaxPendingHandshakes = 256;

        /// <summary>Maximum number of subscriptions of one connection.</summary>
        public int MaxSubscriptions = 10000;

        public int HandshakeTimeoutMs = 10000;
        public int ConnectTimeoutMs = 3000;
        public int MinReconnectMs = 50;
        public int MaxReconnectMs = 1000;

        /// <summary>Interval of PING on connections to other computers; 0 to send none.</summary>
        public int HeartbeatMs = 5000;

        /// <summary>True to send PING to peers on this computer, too, for tests.</summary>
        public bool IsHeartbeatLocal = false;

        /// <summary>Time without input after which peers on other computers are disconnected.</summary>
        public int HeartbeatTimeoutMs = 15000;
    }
}
