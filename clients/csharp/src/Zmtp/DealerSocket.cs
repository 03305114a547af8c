using System;

namespace Nep.Zmtp
{
    /// <summary>What a <see cref="DealerSocket"/> tells its owner, in a thread of the socket.</summary>
    internal interface IDealerOwner
    {
        void Connected();

        void Received(byte[][] parts);

        void Disconnected(string reason);
    }

    /// <summary>DEALER that is connected to one ROUTER. Sends nothing while there is no connection. Thread-safe.</summary>
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

        /// <summary>Connections that were closed because of what the peer sent.</summary>
        public CloseCounter Refused { get; private set; }

        /// <summary>The present connection, or null.</summary>
        public Connection Connection
        {
            get { return _connector.Connection; }
        }

        /// <summary>What is wrong with the program at the address; see <see cref="Connector.Problem"/>.</summary>
        public string Problem
        {
            get { return _connector.Problem; }
        }

        public void Start()
        {
            _connector.Start();
        }

        /// <summary>Queue a message; false when there is no connection or its queue is full.</summary>
        public bool Send(params byte[][] parts)
        {
            return _connector.Send(EncodedMessage.Message(parts));
        }

        /// <summary>Deliver what is queued, for <paramref name="lingerMs"/> at most, and close.</summary>
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
