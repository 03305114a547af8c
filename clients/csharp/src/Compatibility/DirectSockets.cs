using System;
using System.Text;
using Nep.Session;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep
{
    /// <summary>Publisher of the original wire, bound to one port; sends frames of the form <c>TOPIC TEXT</c>. Thread-safe.</summary>
    internal sealed class DirectPublisher : IXPubOwner
    {
        private readonly XPubSocket _socket;
        private readonly byte[] _topic;
        private readonly string _prefix;

        /// <exception cref="NepException">The port can't be bound.</exception>
        public DirectPublisher(string topic, string host, int port)
        {
            _topic = Encoding.UTF8.GetBytes(topic);
            _prefix = topic + " ";
            _socket = new XPubSocket(this, new ZmtpLimits(), NullMechanism.Create);
            try
            {
                _socket.Acceptor.Bind(host, port);
            }
            catch (System.Net.Sockets.SocketException exception)
            {
                throw new NepException("Can't bind " + host + ":" + port + ": " + exception.Message + ".");
            }
        }

        public void Send(string text)
        {
            _socket.Send(_topic, EncodedMessage.Message(Encoding.UTF8.GetBytes(_prefix + text)));
        }

        public void Close(int lingerMs)
        {
            _socket.Close(lingerMs);
        }

        void IXPubOwner.FilterChanged(XPubPeer peer, byte[] filter, bool isSubscribed)
        {
        }

        void IXPubOwner.Left(XPubPeer peer)
        {
        }

        void IXPubOwner.Rejected(string reason)
        {
        }
    }

    /// <summary>Subscriber of the original wire, connected to one port. Thread-safe.</summary>
    internal sealed class DirectSubscriber : ISubOwner
    {
        private readonly string _topic;
        private readonly byte[] _prefix;
        private readonly SubSocket _socket;

        public DirectSubscriber(string topic, string host, int port)
        {
            _topic = topic;
            _prefix = Encoding.UTF8.GetBytes(topic + " ");
            Inbox = new Inbox(new SubscriberOptions());
            _socket = new SubSocket(this, new ZmtpLimits(), NullMechanism.Create);
            _socket.Subscribe(Encoding.UTF8.GetBytes(topic));
            _socket.Connect(ZmtpEndpoint.Format(host, port), null);
        }

        public Inbox Inbox { get; private set; }

        public void Close()
        {
            _socket.Dispose();
            Inbox.Close();
        }

        void ISubOwner.Received(SubConnection from, byte[][] parts)
        {
            if (parts.Length != 1 || !ByteOrder.StartsWith(parts[0], _prefix))
            {
                return; // ZeroMQ compares prefixes: "cam" also matches "camera ..."
            }
            int size = parts[0].Length - _prefix.Length;
            Inbox.Put(new Message(new WireMessage
            {
                Topic = _topic,
                Header = new Header { Codec = Codec.For("string").Number, StampNs = Clock.NowNs, PayloadSize = (uint)size },
                Payload = new ArraySegment<byte>(parts[0], _prefix.Length, size),
            }, "string", null));
        }

        void ISubOwner.Disconnected(SubConnection from, string reason)
        {
        }
    }
}
