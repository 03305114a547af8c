using System;
using System.Collections.Generic;
using System.Net;
using System.Net.Sockets;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>What an <see cref="XPubSocket"/> tells its owner, in the thread of the connection.</summary>
    internal interface IXPubOwner
    {
        /// <summary>A filter came (also one that the peer has already) or was taken back.</summary>
        void FilterChanged(XPubPeer peer, byte[] filter, bool isSubscribed);

        /// <summary>A peer is gone, with all of its filters.</summary>
        void Left(XPubPeer peer);

        /// <summary>A peer sent something that is no subscription.</summary>
        void Rejected(string reason);
    }

    /// <summary>One subscriber's connection.</summary>
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

        /// <summary>Queue a message whether or not a filter asks for it; false when it was dropped.</summary>
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

    /// <summary>XPUB that is bound at one or more addresses. Thread-safe.</summary>
    internal sealed class XPubSocket : IDisposable
    {
        /// <summary>Longest subscription in bytes; who sends more is disconnected.</summary>
        public const int MaxFilterBytes = 4096;

        private readonly object _lock = new object();
        private readonly Dictionary<string, Listener> _listeners = new Dictionary<string, Listener>();
        private readonly HashSet<Connection> _pending = new HashSet<Connection>();
        private readonly List<XPubPeer> _peers = new List<XPubPeer>();
        private readonly IXPubOwner _owner;
        private readonly ZmtpLimits _limits;
        private readonly MechanismFactory _mechanism;
        private XPubPeer[] _snapshot = new XPubPeer[0];
        private bool _isClosed;

        public XPubSocket(IXPubOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _owner = owner;
            _limits = limits;
            _limits.MaxMessageBytes = MaxFilterBytes + 1;
            _limits.MaxParts = 1;
            _mechanism = mechanism;
            Refused = new CloseCounter();
        }

        /// <summary>Connections that were closed because of what the peer sent, or for lack of room.</summary>
        public CloseCounter Refused { get; private set; }

        /// <summary>Connections after their handshake.</summary>
        public XPubPeer[] Peers
        {
            get { return _snapshot; }
        }

        /// <summary>Bind at a free port of an address and return it.</summary>
        /// <param name="host">An IPv4 or IPv6 address, or a name of this computer.</param>
        /// <param name="isAllowed">Ports that may be taken; others are given back.</param>
        /// <exception cref="SocketException">The address cannot be bound.</exception>
        public int Bind(string host, Predicate<int> isAllowed)
        {
            ZmtpEndpoint endpoint;
            if (!ZmtpEndpoint.TryParse(ZmtpEndpoint.Format(host, 1), out endpoint))
            {
                throw new SocketException((int)SocketError.HostNotFound);
            }
            IPAddress address = endpoint.Resolve()[0];
            var rejected = new List<Socket>();
            try
            {
                while (true)
                {
                    var socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp);
                    rejected.Add(socket);
                    socket.Bind(new IPEndPoint(address, 0));
                    int port = ((IPEndPoint)socket.LocalEndPoint).Port;
                    if (isAllowed(port))
                    {
                        rejected.Remove(socket);
                        socket.Listen(128);
                        Listen(host, socket);
                        return port;
                    }
                    if (rejected.Count > 100)
                    {
                        throw new SocketException((int)SocketError.AddressAlreadyInUse);
                    }
                }
            }
            finally
            {
                foreach (Socket each in rejected)
                {
                    each.Close();
                }
            }
        }

        /// <summary>Accept no further connections at an address. Present ones stay.</summary>
        public void Unbind(string host)
        {
            Listener listener;
            lock (_lock)
            {
                if (!_listeners.TryGetValue(host, out listener))
                {
                    return;
                }
                _listeners.Remove(host);
            }
            listener.Close();
        }

        /// <summary>Send to every peer with a filter that <paramref name="first"/> begins with; returns how many took it.</summary>
        public int Send(byte[] first, EncodedMessage message)
        {
            int count = 0;
            foreach (XPubPeer peer in _snapshot)
            {
                if (peer.Wants(first) && peer.Send(message))
                {
                    count++;
                }
            }
            return count;
        }

        /// <summary>Deliver what is queued, for <paramref name="lingerMs"/> at most, and close.</summary>
        public void Close(int lingerMs)
        {
            var watch = System.Diagnostics.Stopwatch.StartNew();
            foreach (XPubPeer peer in _snapshot)
            {
                int left = lingerMs - (int)watch.ElapsedMilliseconds;
                if (left > 0)
                {
                    peer.Connection.Flush(left);
                }
            }
            List<Connection> open;
            List<Listener> listeners;
            lock (_lock)
            {
                _isClosed = true;
                listeners = new List<Listener>(_listeners.Values);
                _listeners.Clear();
                open = new List<Connection>(_pending);
                foreach (XPubPeer peer in _peers)
                {
                    open.Add(peer.Connection);
                }
            }
            foreach (Listener each in listeners)
            {
                each.Close();
            }
            foreach (Connection each in open)
            {
                each.Close();
            }
        }

        public void Dispose()
        {
            Close(0);
        }

        private void Listen(string host, Socket socket)
        {
            var listener = new Listener(socket, Accept);
            lock (_lock)
            {
                if (_isClosed)
                {
                    socket.Close();
                    throw new ObjectDisposedException("XPubSocket");
                }
                _listeners[host] = listener;
            }
            listener.Start();
        }

        private void Accept(Socket socket)
        {
            Connection connection;
            try
            {
                connection = new Connection(socket, "XPUB", true, _limits, _mechanism);
            }
            catch (SocketException)
            {
                socket.Close(); // it is gone already
                return;
            }
            lock (_lock)
            {
                bool hasRoom = _pending.Count < _limits.MaxPendingHandshakes && _peers.Count < _limits.MaxConnections;
                if (_isClosed || !hasRoom)
                {
                    if (!_isClosed)
                    {
                        Refused.Add("too-many-connections");
                    }
                    connection.Close();
                    return;
                }
                _pending.Add(connection);
            }
            var thread = new Thread(() => Serve(connection), 256 * 1024) { IsBackground = true, Name = "nep xpub" };
            thread.Start();
        }

        private void Serve(Connection connection)
        {
            XPubPeer peer = null;
            try
            {
                connection.Handshake();
                peer = Admit(connection);
                while (peer != null)
                {
                    TakeSubscription(peer, connection.ReadMessage());
                }
            }
            catch (ZmtpException exception)
            {
                Refused.Add(exception.Code);
            }
            catch (ConnectionClosedException)
            {
            }
            catch (Exception exception) // whatever a peer sends, the thread goes on
            {
                Refused.Add("unexpected-" + exception.GetType().Name);
            }
            finally
            {
                connection.Close();
                lock (_lock)
                {
                    _pending.Remove(connection);
                    if (peer != null)
                    {
                        _peers.Remove(peer);
                        _snapshot = _peers.ToArray();
                    }
                }
                if (peer != null)
                {
                    _owner.Left(peer);
                }
            }
        }

        private XPubPeer Admit(Connection connection)
        {
            lock (_lock)
            {
                _pending.Remove(connection);
                if (_isClosed)
                {
                    return null;
                }
                var peer = new XPubPeer(connection);
                _peers.Add(peer);
                _snapshot = _peers.ToArray();
                return peer;
            }
        }

        private void TakeSubscription(XPubPeer peer, byte[][] parts)
        {
            byte[] body = parts[0];
            if (parts.Length != 1 || body.Length < 1 || body[0] > 1)
            {
                _owner.Rejected("it is no subscription");
                return;
            }
            var filter = new byte[body.Length - 1];
            Buffer.BlockCopy(body, 1, filter, 0, filter.Length);
            if (body[0] == 1)
            {
                if (peer.FilterCount >= _limits.MaxSubscriptions)
                {
                    throw new ZmtpException("too-many-subscriptions", "a connection has more than " + _limits.MaxSubscriptions + " subscriptions");
                }
                peer.Add(filter);
                _owner.FilterChanged(peer, filter, true);
            }
            else if (peer.Remove(filter))
            {
                _owner.FilterChanged(peer, filter, false);
            }
        }

        /// <summary>A listening socket with the thread that accepts.</summary>
        private sealed class Listener
        {
            private readonly Socket _socket;
            private readonly Action<Socket> _accepted;
            private volatile bool _isClosed;

            public Listener(Socket socket, Action<Socket> accepted)
            {
                _socket = socket;
                _accepted = accepted;
                _socket.Blocking = false;
            }

            public void Start()
            {
                new Thread(Run, 128 * 1024) { IsBackground = true, Name = "nep listener" }.Start();
            }

            public void Close()
            {
                _isClosed = true;
                _socket.Close();
            }

            private void Run()
            {
                while (!_isClosed)
                {
                    try
                    {
                        if (_socket.Poll(500000, SelectMode.SelectRead))
                        {
                            _accepted(_socket.Accept());
                        }
                    }
                    catch (ObjectDisposedException)
                    {
                        return;
                    }
                    catch (SocketException exception)
                    {
                        if (_isClosed)
                        {
                            return;
                        }
                        if (exception.SocketErrorCode != SocketError.WouldBlock)
                        {
                            Thread.Sleep(100); // too many open files: the connection waits in the backlog
                        }
                    }
                }
            }
        }
    }
}
