using System;

namespace Nep.Zmtp
{
    /// <summary>Events of a <see cref="DealerSocket"/>, raised in its thread.</summary>
    internal interface IDealerOwner
    {
        void Connected();

        void Received(byte[][] parts);

        void Disconnected(string reason);
    }

    /// <summary>DEALER socket connected to one ROUTER. Queues nothing while disconnected. Thread-safe.</summary>
    internal sealed class DealerSocket : IConnectorOwner, IDisposable
    {
        private readonly IDealerOwner _owner;
        private readonly Connector _connector;

        public DealerSocket(ZmtpEndpoint endpoint, IDealerOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _owner = owner;
            Refused = new CloseCounter();
            _connector = new Connector(endpoint, "DEALER", limits, mechanism, this, Refused);
        }

        /// <summary>Counter of connections closed because of protocol errors.</summary>
        public CloseCounter Refused { get; private set; }

        /// <summary>Established connection, or null.</summary>
        public Connection Connection
        {
            get { return _connector.Connection; }
        }

        /// <summary>See <see cref="Connector.Problem"/>.</summary>
        public string Problem
        {
            get { return _connector.Problem; }
        }

        public void Start()
        {
            _connector.Start();
        }

        /// <summary>Queue a message; return false if there is no connection or its queue is full.</summary>
        public bool Send(params byte[][] parts)
        {
            return _connector.Send(EncodedMessage.Message(parts));
        }

        /// <summary>Send queued messages for at most <paramref name="lingerMs"/>, and close.</summary>
        public void Close(int lingerMs)
        {
            Connection connection = _connector.Connection;
            if (connection != null && lingerMs > 0)
            {
                connection.Flush(lingerMs);
            }
            _connector.Close();
            _connector.Join(1000);
        }

        public void Dispose()
        {
            Close(0);
        }

        void IConnectorOwner.Connected(Connector connector, Connection connection)
        {
            _owner.Connected();
        }

        void IConnectorOwner.Received(Connector connector, byte[][] parts)
        {
            _owner.Received(parts);
        }

        void IConnectorOwner.Disconnected(Connector connector, string reason)
        {
            _owner.Disconnected(reason);
        }
    }
}
