using System;
using System.Collections.Generic;
using System.Net;
using System.Net.Sockets;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>Events of an <see cref="Acceptor"/>, raised in the thread of the connection.</summary>
    internal interface IAcceptorOwner
    {
        /// <summary>Called after the handshake of a connection.</summary>
        void Opened(Connection connection);

        /// <exception cref="ZmtpException">The connection must be closed; the exception contains the reason.</exception>
        void Received(Connection connection, byte[][] parts);

        void Closed(Connection connection);
    }

    /// <summary>Bound addresses and their incoming connections, each with a reading thread. Thread-safe.</summary>
    internal sealed class Acceptor
    {
        private readonly object _lock = new object();
        private readonly Dictionary<string, Listener> _listeners = new Dictionary<string, Listener>();
        private readonly HashSet<Connection> _pending = new HashSet<Connection>();
        private readonly List<Connection> _open = new List<Connection>();
        private readonly string _socketType;
        private readonly IAcceptorOwner _owner;
        private readonly ZmtpLimits _limits;
        private readonly MechanismFactory _mechanism;
        private Connection[] _snapshot = new Connection[0];
        private bool _isClosed;

        public Acceptor(string socketType, IAcceptorOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _socketType = socketType;
            _owner = owner;
            _limits = limits;
            _mechanism = mechanism;
            Refused = new CloseCounter();
        }

        /// <summary>Counter of connections closed because of protocol errors or limits.</summary>
        public CloseCounter Refused { get; private set; }

        /// <summary>Established connections.</summary>
        public Connection[] Connections
        {
            get { return _snapshot; }
        }

        /// <summary>Bind to a free port of an address and return the port.</summary>
        /// <param name="host">An IPv4 or IPv6 address, or a name of this computer.</param>
        /// <param name="isAllowed">Returns true for ports that may be used.</param>
        /// <exception cref="SocketException">The address can't be bound.</exception>
        public int Bind(string host, Predicate<int> isAllowed)
        {
            IPAddress address = AddressOf(host);
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

        /// <summary>Bind to a port of an address.</summary>
        /// <exception cref="SocketException">The port can't be bound.</exception>
        public void Bind(string host, int port)
        {
            IPAddress address = AddressOf(host);
            var socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp);
            try
            {
                socket.Bind(new IPEndPoint(address, port));
                socket.Listen(128);
            }
            catch
            {
                socket.Close();
                throw;
            }
            Listen(host, socket);
        }

        /// <summary>Stop accepting connections at an address; existing ones stay open.</summary>
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

        /// <summary>Send queued messages for at most <paramref name="lingerMs"/>, and close.</summary>
        public void Close(int lingerMs)
        {
            var deadline = new Deadline(lingerMs);
            foreach (Connection each in _snapshot)
            {
                each.Flush(deadline.LeftMs);
            }
            List<Connection> open;
            List<Listener> listeners;
            lock (_lock)
            {
                _isClosed = true;
                listeners = new List<Listener>(_listeners.Values);
                _listeners.Clear();
                open = new List<Connection>(_pending);
                open.AddRange(_open);
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

        private static IPAddress AddressOf(string host)
        {
            ZmtpEndpoint endpoint;
            if (!ZmtpEndpoint.TryParse(ZmtpEndpoint.Format(host, 1), out endpoint))
            {
                throw new SocketException((int)SocketError.HostNotFound);
            }
            return endpoint.Resolve()[0];
        }

        private void Listen(string host, Socket socket)
        {
            var listener = new Listener(socket, Accept);
            lock (_lock)
            {
                if (_isClosed)
                {
                    socket.Close();
                    throw new ObjectDisposedException("Acceptor");
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
                connection = new Connection(socket, _socketType, true, _limits, _mechanism);
            }
            catch (SocketException)
            {
                socket.Close(); // already disconnected
                return;
            }
            lock (_lock)
            {
                bool hasRoom = _pending.Count < _limits.MaxPendingHandshakes && _open.Count < _limits.MaxConnections;
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
            BackgroundThread.Start(_socketType.ToLowerInvariant(), () => Serve(connection), BackgroundThread.SmallStackBytes);
        }

        private void Serve(Connection connection)
        {
            bool isOpen = false;
            try
            {
                connection.Handshake();
                isOpen = Admit(connection);
                if (isOpen)
                {
                    _owner.Opened(connection);
                }
                while (isOpen)
                {
                    _owner.Received(connection, connection.ReadMessage());
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
                    _open.Remove(connection);
                    _snapshot = _open.ToArray();
                }
                if (isOpen)
                {
                    _owner.Closed(connection);
                }
            }
        }

        private bool Admit(Connection connection)
        {
            lock (_lock)
            {
                _pending.Remove(connection);
                if (_isClosed)
                {
                    return false;
                }
                _open.Add(connection);
                _snapshot = _open.ToArray();
                return true;
            }
        }

        /// <summary>Listening socket with its accepting thread.</summary>
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
                BackgroundThread.Start("listener", Run, BackgroundThread.SmallStackBytes);
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
