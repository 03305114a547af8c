using System;

namespace Nep
{
    /// <summary>Options of a <see cref="Node"/>.</summary>
    public sealed class NodeOptions
    {
        /// <summary>Address of the master, <c>HOST</c> or <c>HOST:PORT</c>. Null: the environment variable <c>NEP_MASTER</c>, or 127.0.0.1:7780 if it isn't set.</summary>
        public string Master { get; set; }

        /// <summary>Maximum time to wait for a reply of the master; <see cref="System.Threading.Timeout.InfiniteTimeSpan"/> waits without a limit. Default: 2 s.</summary>
        public TimeSpan MasterTimeout { get; set; } = TimeSpan.FromSeconds(2);

        /// <summary>Maximum time that <see cref="Node.Close()"/> waits until subscribers have received all messages. Default: 2 s.</summary>
        public TimeSpan CloseTimeout { get; set; } = TimeSpan.FromSeconds(2);
    }

    /// <summary>Options of a <see cref="Publisher"/>.</summary>
    public sealed class PublisherOptions
    {
        /// <summary>True to send the newest message to late subscribers. Default: false.</summary>
        public bool Latched { get; set; }

        /// <summary>Number of past messages that late subscribers receive, 0 to 10 000. Default: 0.</summary>
        public int History { get; set; }

        /// <summary>Address of the master, <c>HOST</c> or <c>HOST:PORT</c>. Null: the node's master.</summary>
        public string Master { get; set; }
    }

    /// <summary>Options of a <see cref="Subscriber"/>.</summary>
    public sealed class SubscriberOptions
    {
        /// <summary>True to keep only the newest message; replaced messages don't count as lost. Default: false.</summary>
        public bool KeepLatest { get; set; }

        /// <summary>True to treat the levels <c>*</c> and <c>**</c> of the topic as wildcards. Default: true.</summary>
        public bool Wildcards { get; set; } = true;

        /// <summary>Maximum number of queued messages; the oldest are dropped and counted in <see cref="Subscriber.Lost"/>. Default: 10 000.</summary>
        public int MaxMessages { get; set; } = 10000;

        /// <summary>Maximum size of the queued payloads in bytes. Default: 256 MB.</summary>
        public long MaxBytes { get; set; } = 256L << 20;

        /// <summary>Thread of callbacks. Default: <see cref="CallbackMode.Thread"/>.</summary>
        public CallbackMode Callbacks { get; set; }

        /// <summary>Address of the master, <c>HOST</c> or <c>HOST:PORT</c>. Null: the node's master.</summary>
        public string Master { get; set; }
    }

    /// <summary>Thread in which the callback of a subscription is called.</summary>
    public enum CallbackMode
    {
        /// <summary>A background thread of the subscription, sequentially.</summary>
        Thread,

        /// <summary>The thread that calls <see cref="Node.Update(TimeSpan)"/>, such as Unity's main thread.</summary>
        Update,
    }
}
