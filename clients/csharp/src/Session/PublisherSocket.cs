using System;
using System.Collections.Generic;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>XPUB socket of a publisher with its subscribers. Thread-safe.</summary>
    internal sealed class PublisherSocket : IXPubOwner, ISessionPublisher
    {
        private const int OnePartBelowBytes = 16384;
        private const int ByeAgainMs = 50;

        private readonly object _lock = new object();
        private readonly XPubSocket _socket;
        private readonly byte[] _topic;
        private readonly byte _codec;
        private readonly Dictionary<ulong, XPubPeer> _greeted = new Dictionary<ulong, XPubPeer>();
        private readonly Bindings _bindings;
        private readonly Queue<byte[][]> _history = new Queue<byte[][]>();
        private readonly int _historySize;
        private ulong _seq;
        private ulong _bytes;
        private ulong _lastStampNs;
        private long _rejected;
        private string _problem = "";
        private bool _isClosing;

        public PublisherSocket(PublisherRecord record, byte codec)
        {
            Record = record;
            _codec = codec;
            _topic = Names.TopicPart(record.Topic);
            _historySize = record.IsLatched ? Math.Max(1, record.History) : record.History;
            _socket = new XPubSocket(this, new ZmtpLimits(), NullMechanism.Create);
            _bindings = new Bindings(_socket.Acceptor);
        }

        public PublisherRecord Record { get; private set; }

        public ulong LastSeq
        {
            get
            {
                lock (_lock)
                {
                    return _seq;
                }
            }
        }

        /// <summary>Number of messages not sent to a subscriber because too many bytes were in flight.</summary>
        public long Dropped { get; private set; }

        public int SubscriberCount
        {
            get
            {
                lock (_lock)
                {
                    return _greeted.Count;
                }
            }
        }

        /// <summary>Encoding error of the last payload, reported in the next renewal; cleared by the next message.</summary>
        public string Problem
        {
            set { _problem = value; }
        }

        public Dictionary<object, object> Statistics()
        {
            lock (_lock)
            {
                var statistics = new Dictionary<object, object> { { "id", Record.Id }, { "count", _seq }, { "bytes", _bytes }, { "last_seq", _seq } };
                if (_seq > 0)
                {
                    statistics["last_stamp_ns"] = _lastStampNs;
                }
                if (_problem.Length > 0)
                {
                    statistics["problem"] = _problem;
                }
                return statistics;
            }
        }

        public bool Move(IList<string> hosts)
        {
            lock (_lock)
            {
                return !_isClosing && _bindings.Move(hosts, Record);
            }
        }

        /// <summary>Send a message to all subscribers. The caller must not modify <paramref name="payload"/> afterwards.</summary>
        /// <exception cref="ObjectDisposedException">The publisher is closed.</exception>
        public void Send(byte[] payload, byte[] extension)
        {
            lock (_lock)
            {
                if (_isClosing)
                {
                    throw new ObjectDisposedException("Publisher");
                }
                _problem = "";
                _seq++;
                _bytes += (ulong)payload.Length;
                _lastStampNs = Clock.NowNs;
                byte[] header = HeaderOf(payload, extension);
                byte[][] tail = extension == null ? new[] { header, payload } : new[] { header, payload, extension };
                Keep(tail);
                EncodedMessage whole = null, apart = null;
                foreach (XPubPeer peer in _socket.Peers)
                {
                    var state = (Reader)peer.Tag;
                    if (state == null || state.TopicFilters.Count == 0)
                    {
                        continue;
                    }
                    bool isOnePart = state.Level >= 1 && extension == null && payload.Length < OnePartBelowBytes;
                    EncodedMessage message = isOnePart
                        ? whole ?? (whole = EncodedMessage.Message(Joined(header, payload)))
                        : apart ?? (apart = EncodedMessage.Message(WithFirst(_topic, tail)));
                    SendTo(peer, state, message, payload.Length);
                }
            }
        }

        /// <summary>Wait for the hellos of the expected subscribers; return those that are missing after the timeout.</summary>
        public List<ExpectedSubscriber> WaitFor(List<ExpectedSubscriber> expected, int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                while (true)
                {
                    List<ExpectedSubscriber> missing = expected.FindAll(each => !_greeted.ContainsKey(each.Id));
                    if (missing.Count == 0 || deadline.IsOver)
                    {
                        return missing;
                    }
                    deadline.Wait(_lock);
                }
            }
        }

        public void BeginClose()
        {
            lock (_lock)
            {
                _isClosing = true;
                Bye();
            }
        }

        public void Finish(int timeoutMs)
        {
            var deadline = new Deadline(Math.Max(0, timeoutMs));
            lock (_lock)
            {
                while (_greeted.Count > 0 && !deadline.IsOver)
                {
                    if (!Monitor.Wait(_lock, Math.Min(deadline.LeftMs, ByeAgainMs)))
                    {
                        Bye(); // repeated, because a full queue drops it
                    }
                }
            }
            _socket.Close(deadline.LeftMs);
        }

        // ---- in the connections' threads

        void IXPubOwner.FilterChanged(XPubPeer peer, byte[] filter, bool isSubscribed)
        {
            Hello hello;
            ReadAnswer answer;
            lock (_lock)
            {
                var state = (Reader)peer.Tag;
                if (state == null)
                {
                    peer.Tag = state = new Reader();
                }
                if (Filters.TryParseHello(filter, out hello))
                {
                    if (hello.Topic == Record.Topic)
                    {
                        HelloChanged(peer, state, hello, filter, isSubscribed);
                    }
                }
                else if (Filters.TryParseRead(filter, out answer))
                {
                    TakeAnswer(peer, state, answer, isSubscribed);
                }
                else if (ByteOrder.StartsWith(_topic, filter))
                {
                    if (isSubscribed)
                    {
                        state.TopicFilters.Add(filter);
                    }
                    else
                    {
                        state.TopicFilters.Remove(filter);
                    }
                }
                else if (!Filters.IsShares(filter))
                {
                    _rejected++;
                }
            }
        }

        void IXPubOwner.Left(XPubPeer peer)
        {
            lock (_lock)
            {
                var state = (Reader)peer.Tag;
                XPubPeer greeted;
                if (state != null && state.Hello != null && _greeted.TryGetValue(state.Subscriber, out greeted) && greeted == peer)
                {
                    _greeted.Remove(state.Subscriber);
                }
                Monitor.PulseAll(_lock);
            }
        }

        void IXPubOwner.Rejected(string reason)
        {
            lock (_lock)
            {
                _rejected++;
            }
        }

        private void HelloChanged(XPubPeer peer, Reader state, Hello hello, byte[] filter, bool isSubscribed)
        {
            if (!isSubscribed)
            {
                if (state.Hello != null && state.Subscriber == hello.Subscriber)
                {
                    _greeted.Remove(state.Subscriber);
                    state.Hello = null;
                    state.Level = 0;
                    state.Window = null;
                }
            }
            else
            {
                state.Subscriber = hello.Subscriber;
                state.Hello = filter;
                state.Level = hello.Level;
                state.Window = hello.Level >= 2 ? new SendWindow() : null;
                _greeted[hello.Subscriber] = peer;
                Greet(peer, state);
            }
            Monitor.PulseAll(_lock);
        }

        private void Greet(XPubPeer peer, Reader state)
        {
            foreach (byte[][] kept in _history)
            {
                if (peer.Send(EncodedMessage.Message(WithFirst(state.Hello, kept))) && state.Window != null)
                {
                    state.Window.Sent(_seq, kept[1].Length);
                }
            }
            peer.Send(Notice(state, 0));
            if (_isClosing)
            {
                peer.Send(Notice(state, Header.Bye));
            }
        }

        private void TakeAnswer(XPubPeer peer, Reader state, ReadAnswer answer, bool isSubscribed)
        {
            if (isSubscribed && state.Window != null && answer.Publisher == Record.Id && answer.Subscriber == state.Subscriber)
            {
                state.Window.Read(answer.Seq, answer.BoundBytes);
                if (state.Window.IsToTell())
                {
                    peer.Send(Notice(state, 0));
                }
            }
        }

        private void SendTo(XPubPeer peer, Reader state, EncodedMessage message, int size)
        {
            SendWindow window = state.Window;
            bool hasRoom = window == null || window.HasRoom(size);
            if (!hasRoom || !peer.Send(message))
            {
                Dropped++;
                if (window != null)
                {
                    window.Missed();
                }
            }
            else if (window != null)
            {
                window.Sent(_seq, size);
            }
            if (window != null && window.IsToAsk(Clock.SteadyS, hasRoom))
            {
                peer.Send(Notice(state, 0));
            }
        }

        private void Bye()
        {
            foreach (XPubPeer peer in _greeted.Values)
            {
                peer.Send(Notice((Reader)peer.Tag, Header.Bye));
            }
        }

        private EncodedMessage Notice(Reader state, int flags)
        {
            var header = new Header { Codec = _codec, Flags = flags, Seq = _seq, StampNs = Clock.NowNs, Publisher = Record.Id };
            return EncodedMessage.Message(state.Hello, header.ToBytes());
        }

        private byte[] HeaderOf(byte[] payload, byte[] extension)
        {
            var header = new Header { Codec = _codec, Seq = _seq, StampNs = _lastStampNs, Publisher = Record.Id, PayloadSize = (uint)payload.Length };
            header.Flags = (Record.IsLatched ? Header.Latched : 0) | (extension != null ? Header.Extension : 0);
            return header.ToBytes();
        }

        private void Keep(byte[][] tail)
        {
            if (_historySize > 0)
            {
                _history.Enqueue(tail);
                while (_history.Count > _historySize)
                {
                    _history.Dequeue();
                }
            }
        }

        private byte[] Joined(byte[] header, byte[] payload)
        {
            var part = new byte[_topic.Length + header.Length + payload.Length];
            Buffer.BlockCopy(_topic, 0, part, 0, _topic.Length);
            Buffer.BlockCopy(header, 0, part, _topic.Length, header.Length);
            Buffer.BlockCopy(payload, 0, part, _topic.Length + header.Length, payload.Length);
            return part;
        }

        private static byte[][] WithFirst(byte[] first, byte[][] tail)
        {
            var parts = new byte[tail.Length + 1][];
            parts[0] = first;
            tail.CopyTo(parts, 1);
            return parts;
        }

        /// <summary>State of one subscriber's connection.</summary>
        private sealed class Reader
        {
            public readonly HashSet<byte[]> TopicFilters = new HashSet<byte[]>(ByteOrder.Instance);
            public ulong Subscriber;
            public byte[] Hello;
            public int Level;
            public SendWindow Window;
        }
    }
}
