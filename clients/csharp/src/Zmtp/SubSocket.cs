using System;
using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Events of a <see cref="SubSocket"/>, raised in the thread of the connection.</summary>
    internal interface ISubOwner
    {
        void Received(SubConnection from, byte[][] parts);

        void Disconnected(SubConnection from, string reason);
    }

    /// <summary>Connection of a <see cref="SubSocket"/> to one publisher, including reconnections.</summary>
    internal sealed class SubConnection
    {
        internal SubConnection(string endpoint)
        {
            Endpoint = endpoint;
        }

        public string Endpoint { get; private set; }

        /// <summary>Data of the owner.</summary>
        public object Tag { get; set; }

        /// <summary>See <see cref="Zmtp.Connector.Problem"/>.</summary>
        public string Problem
        {
            get { return Connector.Problem; }
        }

        internal Connector Connector { get; set; }
    }

    /// <summary>SUB socket connected to any number of publishers. Thread-safe.</summary>
    /// <remarks>
    /// All filters are sent in byte order right after READY, before anything else: a publisher that receives the last one knows
    /// that the others are installed.
    /// </remarks>
    internal sealed class SubSocket : IConnectorOwner, IDisposable
    {
        private readonly object _lock = new object();
        private readonly SortedDictionary<byte[], bool> _filters = new SortedDictionary<byte[], bool>(ByteOrder.Instance);
        private readonly List<SubConnection> _connections = new List<SubConnection>();
        private readonly ISubOwner _owner;
        private readonly ZmtpLimits _limits;
        private readonly MechanismFactory _mechanism;
        private bool _isClosed;

        public SubSocket(ISubOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _owner = owner;
            _limits = limits;
            _mechanism = mechanism;
            Refused = new CloseCounter();
        }

        /// <summary>Counter of connections closed because of protocol errors.</summary>
        public CloseCounter Refused { get; private set; }

        /// <summary>Subscribe to messages that begin with <paramref name="filter"/>, on existing and future connections.</summary>
        public void Subscribe(byte[] filter)
        {
            lock (_lock)
            {
                if (!_filters.ContainsKey(filter))
                {
                    _filters.Add(filter, true);
                    SendToAll(Subscription(1, filter));
                }
            }
        }

        /// <summary>Remove a filter.</summary>
        public void Unsubscribe(byte[] filter)
        {
            lock (_lock)
            {
                if (_filters.Remove(filter))
                {
                    SendToAll(Subscription(0, filter));
                }
            }
        }

        /// <summary>Subscribe one connection to a filter and take it back at once.</summary>
        public void Signal(SubConnection connection, byte[] filter)
        {
            lock (_lock)
            {
                connection.Connector.Send(Subscription(1, filter));
                connection.Connector.Send(Subscription(0, filter));
            }
        }

        /// <summary>Connect to an endpoint; reconnects automatically.</summary>
        /// <exception cref="ArgumentException">The endpoint is not of the form <c>tcp://HOST:PORT</c>.</exception>
        public SubConnection Connect(string endpoint, object tag)
        {
            ZmtpEndpoint parsed;
            if (!ZmtpEndpoint.TryParse(endpoint, out parsed))
            {
                throw new ArgumentException("Invalid endpoint '" + endpoint + "'. Use tcp://HOST:PORT.", "endpoint");
            }
            var made = new SubConnection(endpoint) { Tag = tag };
            made.Connector = new Connector(parsed, "SUB", _limits, _mechanism, this, Refused) { Tag = made };
            lock (_lock)
            {
                if (_isClosed)
                {
                    throw new ObjectDisposedException("SubSocket");
                }
                _connections.Add(made);
            }
            made.Connector.Start();
            return made;
        }

        /// <summary>Close one connection and discard its undelivered messages.</summary>
        public void Disconnect(SubConnection connection)
        {
            lock (_lock)
            {
                _connections.Remove(connection);
            }
            connection.Connector.Close();
        }

        public void Dispose()
        {
            List<SubConnection> all;
            lock (_lock)
            {
                _isClosed = true;
                all = new List<SubConnection>(_connections);
                _connections.Clear();
            }
            foreach (SubConnection each in all)
            {
                each.Connector.Close();
            }
        }

        void IConnectorOwner.Connected(Connector connector, Connection connection)
        {
            lock (_lock)
            {
                foreach (byte[] filter in _filters.Keys)
                {
                    connection.Send(Subscription(1, filter));
                }
                connection.Tag = this;
            }
        }

        void IConnectorOwner.Received(Connector connector, byte[][] parts)
        {
            _owner.Received((SubConnection)connector.Tag, parts);
        }

        void IConnectorOwner.Disconnected(Connector connector, string reason)
        {
            _owner.Disconnected((SubConnection)connector.Tag, reason);
        }

        private void SendToAll(EncodedMessage message)
        {
            foreach (SubConnection each in _connections)
            {
                Connection connection = each.Connector.Connection;
                if (connection != null && connection.Tag == this) // others receive all filters after their handshake
                {
                    connection.Send(message);
                }
            }
        }

        private static EncodedMessage Subscription(byte kind, byte[] filter)
        {
            var body = new byte[filter.Length + 1];
            body[0] = kind;
            Buffer.BlockCopy(filter, 0, body, 1, filter.Length);
            return EncodedMessage.Message(body);
        }
    }
}
