using System;
using System.Diagnostics;
using System.Net;
using System.Net.Sockets;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>Events of a <see cref="Connector"/>, raised in its thread.</summary>
    internal interface IConnectorOwner
    {
        /// <summary>Called after the handshake, before any other message is sent.</summary>
        void Connected(Connector connector, Connection connection);

        void Received(Connector connector, byte[][] parts);

        /// <summary>Called when the connection has ended; the connector reconnects unless it was closed.</summary>
        void Disconnected(Connector connector, string reason);
    }

    /// <summary>Outgoing connection that is re-established with exponential back-off, in a background thread.</summary>
    internal sealed class Connector
    {
        private const string ClosedHere = "this side closed the connection";
        private readonly ZmtpEndpoint _endpoint;
        private readonly string _socketType;
        private readonly ZmtpLimits _limits;
        private readonly MechanismFactory _mechanism;
        private readonly IConnectorOwner _owner;
        private readonly CloseCounter _refused;
        private readonly ManualResetEvent _stop = new ManualResetEvent(false);
        private readonly Random _random;
        private Thread _thread;
        private volatile Connection _connection;
        private volatile string _problem;
        private int _waitMs;

        public Connector(ZmtpEndpoint endpoint, string socketType, ZmtpLimits limits, MechanismFactory mechanism,
            IConnectorOwner owner, CloseCounter refused)
        {
            _endpoint = endpoint;
            _socketType = socketType;
            _limits = limits;
            _mechanism = mechanism;
            _owner = owner;
            _refused = refused;
            _random = new Random(unchecked(Environment.TickCount * 31 + endpoint.Port));
            _waitMs = limits.MinReconnectMs;
        }

        /// <summary>Data of the owner.</summary>
        public object Tag { get; set; }

        /// <summary>Established connection, or null.</summary>
        public Connection Connection
        {
            get { return _connection; }
        }

        /// <summary>Why the program at the address isn't a compatible peer, such as "it is a PULL socket"; null if it is, or if there is none.</summary>
        public string Problem
        {
            get { return _problem; }
        }

        public void Start()
        {
            _thread = BackgroundThread.Start(_socketType.ToLowerInvariant(), Run, BackgroundThread.SmallStackBytes);
        }

        /// <summary>Queue a message; return false if there is no connection or its queue is full.</summary>
        public bool Send(EncodedMessage message)
        {
            Connection connection = _connection;
            return connection != null && connection.Send(message);
        }

        /// <summary>Close the connection without waiting; no further connection is established.</summary>
        public void Close()
        {
            _stop.Set();
            Connection connection = _connection;
            if (connection != null)
            {
                connection.Close();
            }
        }

        /// <summary>Wait for the thread to end, unless called from it.</summary>
        public void Join(int timeoutMs)
        {
            if (_thread != null && Thread.CurrentThread != _thread)
            {
                _thread.Join(timeoutMs);
            }
        }

        private bool IsStopped
        {
            get { return _stop.WaitOne(0); }
        }

        private void Run()
        {
            while (!IsStopped)
            {
                string reason = ServeOne();
                bool wasReady = _connection != null;
                Connection last = _connection;
                _connection = null;
                if (wasReady)
                {
                    last.Close();
                    _owner.Disconnected(this, reason);
                }
                _stop.WaitOne(NextWaitMs());
            }
        }

        /// <summary>Connect and read until the connection ends; return the reason of its end.</summary>
        private string ServeOne()
        {
            Connection connection = null;
            Stopwatch sinceConnected = null;
            try
            {
                connection = new Connection(Dial(), _socketType, false, _limits, _mechanism);
                connection.Handshake();
                _problem = null;
                _connection = connection;
                if (IsStopped)
                {
                    return ClosedHere;
                }
                _owner.Connected(this, connection);
                sinceConnected = Stopwatch.StartNew();
                while (true)
                {
                    _owner.Received(this, connection.ReadMessage());
                }
            }
            catch (Exception exception) // nothing that a peer sends may end the thread
            {
                return Ended(exception, sinceConnected != null);
            }
            finally
            {
                if (connection != null)
                {
                    connection.Close();
                }
                if (sinceConnected != null && sinceConnected.ElapsedMilliseconds >= _limits.MaxReconnectMs)
                {
                    _waitMs = _limits.MinReconnectMs; // keeps the back-off for a peer that closes each connection at once
                }
            }
        }

        /// <summary>Record why a connection ended, and return the reason.</summary>
        private string Ended(Exception exception, bool wasConnected)
        {
            var broken = exception as ZmtpException;
            if (broken != null)
            {
                _refused.Add(broken.Code);
                _problem = broken.Message;
            }
            else if (exception is ConnectionClosedException)
            {
                _problem = wasConnected ? _problem : "it closed the connection";
            }
            else if (exception is SocketException)
            {
                _problem = null; // no program uses the address
            }
            else if (exception is ObjectDisposedException)
            {
                return ClosedHere;
            }
            else
            {
                _refused.Add("unexpected-" + exception.GetType().Name);
            }
            return exception.Message;
        }

        /// <summary>Return the next delay, which doubles up to the limit, with jitter of a quarter.</summary>
        private int NextWaitMs()
        {
            int wait = _waitMs;
            _waitMs = Math.Min(_limits.MaxReconnectMs, _waitMs * 2);
            return wait - wait / 8 + _random.Next(wait / 4 + 1);
        }

        private Socket Dial()
        {
            SocketException problem = null;
            foreach (IPAddress address in _endpoint.Resolve())
            {
                var socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp);
                try
                {
                    IAsyncResult pending = socket.BeginConnect(new IPEndPoint(address, _endpoint.Port), null, null);
                    int ended = WaitHandle.WaitAny(new[] { pending.AsyncWaitHandle, _stop }, _limits.ConnectTimeoutMs);
                    if (ended == 0)
                    {
                        socket.EndConnect(pending);
                        return socket;
                    }
                    socket.Close();
                    problem = new SocketException((int)SocketError.TimedOut);
                }
                catch (SocketException exception)
                {
                    socket.Close();
                    problem = exception;
                }
                if (IsStopped)
                {
                    break;
                }
            }
            throw problem ?? new SocketException((int)SocketError.HostNotFound);
        }
    }
}
