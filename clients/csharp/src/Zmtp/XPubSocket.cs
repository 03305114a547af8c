using System;
using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Events of an <see cref="XPubSocket"/>, raised in the thread of the connection.</summary>
    internal interface IXPubOwner
    {
        /// <summary>Called when a filter was added, including duplicates, or removed.</summary>
        void FilterChanged(XPubPeer peer, byte[] filter, bool isSubscribed);

        /// <summary>Called when a peer has disconnected, with all its filters.</summary>
        void Left(XPubPeer peer);

        /// <summary>Called when a peer has sent a malformed subscription.</summary>
        void Rejected(string reason);
    }

    /// <summary>Connection of one subscriber.</summary>
    internal sealed class XPubPeer
    {
        private readonly HashSet<byte[]> _filters = new HashSet<byte[]>(ByteOrder.Instance);

        internal XPubPeer(Connection connection)
        {
            Connection = connection;
        }

        public Connection Connection { get; private set; }

        /// <summary>Data of the owner.</summary>
        public object Tag { get; set; }

        internal int FilterCount
        {
            get { return _filters.Count; }
        }

        /// <summary>Queue a message regardless of the filters; return false if it was dropped.</summary>
        public bool Send(EncodedMessage message)
        {
            return Connection.Send(message);
        }

        public bool Wants(byte[] first)
        {
            lock (_filters)
            {
                foreach (byte[] filter in _filters)
                {
                    if (ByteOrder.StartsWith(first, filter))
                    {
                        return true;
                    }
                }
                return false;
            }
        }

        internal void Add(byte[] filter)
        {
            lock (_filters)
            {
                _filters.Add(filter);
            }
        }

        internal bool Remove(byte[] filter)
        {
            lock (_filters)
            {
                return _filters.Remove(filter);
            }
        }
    }

    /// <summary>XPUB socket bound to one or more addresses. Thread-safe.</summary>
    internal sealed class XPubSocket : IAcceptorOwner, IDisposable
    {
        /// <summary>Maximum size of a subscription in bytes; peers that send more are disconnected.</summary>
        public const int MaxFilterBytes = 4096;

        private readonly IXPubOwner _owner;
        private readonly ZmtpLimits _limits;
        private readonly Acceptor _acceptor;

        public XPubSocket(IXPubOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _owner = owner;
            _limits = limits;
            _limits.MaxMessageBytes = MaxFilterBytes + 1;
            _limits.MaxParts = 1;
            _acceptor = new Acceptor("XPUB", this, limits, mechanism);
        }

        /// <summary>Counter of connections closed because of protocol errors or limits.</summary>
        public CloseCounter Refused
        {
            get { return _acceptor.Refused; }
        }

        /// <summary>Connected subscribers.</summary>
        public IEnumerable<XPubPeer> Peers
        {
            get
            {
                foreach (Connection each in _acceptor.Connections)
                {
                    var peer = (XPubPeer)each.Tag;
                    if (peer != null)
                    {
                        yield return peer;
                    }
                }
            }
        }

        /// <summary>Bound addresses and connections.</summary>
        public Acceptor Acceptor
        {
            get { return _acceptor; }
        }

        /// <summary>Send a message to every peer with a filter that is a prefix of <paramref name="first"/>; return the number of peers.</summary>
        public int Send(byte[] first, EncodedMessage message)
        {
            int count = 0;
            foreach (XPubPeer peer in Peers)
            {
                if (peer.Wants(first) && peer.Send(message))
                {
                    count++;
                }
            }
            return count;
        }

        /// <summary>Send queued messages for at most <paramref name="lingerMs"/>, and close.</summary>
        public void Close(int lingerMs)
        {
            _acceptor.Close(lingerMs);
        }

        public void Dispose()
        {
            Close(0);
        }

        void IAcceptorOwner.Opened(Connection connection)
        {
            connection.Tag = new XPubPeer(connection);
        }

        void IAcceptorOwner.Received(Connection connection, byte[][] parts)
        {
            TakeSubscription((XPubPeer)connection.Tag, parts);
        }

        void IAcceptorOwner.Closed(Connection connection)
        {
            _owner.Left((XPubPeer)connection.Tag);
        }

        private void TakeSubscription(XPubPeer peer, byte[][] parts)
        {
            byte[] body = parts[0];
            if (parts.Length != 1 || body.Length < 1 || body[0] > 1)
            {
                _owner.Rejected("malformed subscription");
                return;
            }
            var filter = new byte[body.Length - 1];
            Buffer.BlockCopy(body, 1, filter, 0, filter.Length);
            if (body[0] == 1)
            {
                if (peer.FilterCount >= _limits.MaxSubscriptions)
                {
                    throw new ZmtpException("too-many-subscriptions", "it sent more than " + _limits.MaxSubscriptions + " subscriptions");
                }
                peer.Add(filter);
                _owner.FilterChanged(peer, filter, true);
            }
            else if (peer.Remove(filter))
            {
                _owner.FilterChanged(peer, filter, false);
            }
        }
    }
}
