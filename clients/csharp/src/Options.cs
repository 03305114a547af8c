using System;

namespace Nep
{
    /// <summary>Options of a <see cref="Node"/>.</summary>
    public sealed class NodeOptions
    {
        /// <summary>Address of the master, <c>HOST</c> or <c>HOST:PORT</c>. Null: environment variable <c>NEP_MASTER</c>, else 127.0.0.1:7780.</summary>
        public string Master { get; set; }

        /// <summary>Longest wait for an answer of the master; <see cref="System.Threading.Timeout.InfiniteTimeSpan"/> waits for ever. Default: 2 s.</summary>
        public TimeSpan MasterTimeout { get; set; } = TimeSpan.FromSeconds(2);

        /// <summary>Longest wait of <see cref="Node.Close()"/> for subscribers that have not received everything. Default: 2 s.</summary>
        public TimeSpan CloseTimeout { get; set; } = TimeSpan.FromSeconds(2);
    }

    /// <summary>Options of a <see cref="Publisher"/>.</summary>
    public sealed class PublisherOptions
    {
        /// <summary>Whether subscribers that connect later receive the last message. Default: false.</summary>
        public bool Latched { get; set; }

        /// <summary>How many of the last messages later subscribers receive, 0 to 10 000. Default: 0.</summary>
        public int History { get; set; }

        /// <summary>Master to register with instead of the node's, <c>HOST</c> or <c>HOST:PORT</c>.</summary>
        public string Master { get; set; }
    }

    /// <summary>Options of a <see cref="Subscriber"/>.</summary>
    public sealed class SubscriberOptions
    {
        /// <summary>Whether only the newest message is kept; older ones that were not read are replaced and not counted as lost. Default: false.</summary>
        public bool KeepLatest { get; set; }

        /// <summary>Whether a level <c>*</c> or <c>**</c> of the topic stands for other topics. Default: true.</summary>
        public bool Wildcards { get; set; } = true;

        /// <summary>Most messages that wait to be read; the oldest are dropped and counted in <see cref="Subscriber.Lost"/>. Default: 10 000.</summary>
        public int MaxMessages { get; set; } = 10000;

        /// <summary>Most bytes of payloads that wait to be read. Default: 256 MB.</summary>
        public long MaxBytes { get; set; } = 256L << 20;

        /// <summary>Where callbacks run. Default: <see cref="CallbackMode.Thread"/>.</summary>
        public CallbackMode Callbacks { get; set; }

        /// <summary>Master to register with instead of the node's, <c>HOST</c> or <c>HOST:PORT</c>.</summary>
        public string Master { get; set; }
    }

    /// <summary>Where the callback of a subscription runs.</summary>
    public enum CallbackMode
    {
        /// <summary>In a background thread of the subscriber, one message after the other.</summary>
        Thread,

        /// <summary>In the thread that calls <see cref="Node.Update(TimeSpan)"/>, such as Unity's main thread.</summary>
        Update,
    }
}
