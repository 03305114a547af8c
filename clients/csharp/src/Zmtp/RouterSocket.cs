namespace Nep.Zmtp
{
    /// <summary>Events of a <see cref="RouterSocket"/>, raised in the thread of the connection.</summary>
    internal interface IRouterOwner
    {
        void Received(Connection from, byte[][] parts);

        void Left(Connection connection);
    }

    /// <summary>ROUTER socket bound to one or more addresses; replies are sent to a connection, not to a routing id. Thread-safe.</summary>
    internal sealed class RouterSocket : IAcceptorOwner
    {
        private readonly IRouterOwner _owner;

        public RouterSocket(IRouterOwner owner, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _owner = owner;
            Acceptor = new Acceptor("ROUTER", this, limits, mechanism);
        }

        /// <summary>Bound addresses and connections.</summary>
        public Acceptor Acceptor { get; private set; }

        void IAcceptorOwner.Opened(Connection connection)
        {
        }

        void IAcceptorOwner.Received(Connection connection, byte[][] parts)
        {
            _owner.Received(connection, parts);
        }

        void IAcceptorOwner.Closed(Connection connection)
        {
            _owner.Left(connection);
        }
    }
}
