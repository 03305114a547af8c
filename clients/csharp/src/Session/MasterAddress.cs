using System;
using System.Net;
using System.Net.Sockets;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Address of a master: <c>HOST</c> or <c>HOST:PORT</c>.</summary>
    internal sealed class MasterAddress
    {
        public const string Loopback = "127.0.0.1";
        private const int DefaultPort = 7780;

        private MasterAddress(ZmtpEndpoint endpoint)
        {
            Endpoint = endpoint;
        }

        public ZmtpEndpoint Endpoint { get; private set; }

        public string Host
        {
            get { return Endpoint.Host; }
        }

        /// <summary>True if the address is a loopback address.</summary>
        public bool IsNear
        {
            get { return Endpoint.IsLoopback; }
        }

        public override string ToString()
        {
            return ZmtpEndpoint.Format(Endpoint.Host, Endpoint.Port).Substring("tcp://".Length);
        }

        /// <summary>Parse an address; null or empty selects <c>NEP_MASTER</c>, or this computer if it isn't set.</summary>
        /// <exception cref="ArgumentException">The address is invalid.</exception>
        public static MasterAddress Parse(string text)
        {
            if (string.IsNullOrEmpty(text))
            {
                text = Environment.GetEnvironmentVariable("NEP_MASTER");
            }
            if (string.IsNullOrEmpty(text))
            {
                text = Loopback;
            }
            ZmtpEndpoint endpoint;
            bool isIPv6 = text.IndexOf(':') != text.LastIndexOf(':') && text[0] != '[';
            bool hasPort = !isIPv6 && text.LastIndexOf(':') > text.LastIndexOf(']');
            string whole = isIPv6 ? ZmtpEndpoint.Format(text, DefaultPort) : hasPort ? "tcp://" + text : "tcp://" + text + ":" + DefaultPort;
            if (!ZmtpEndpoint.TryParse(whole, out endpoint))
            {
                throw new ArgumentException("Invalid master address '" + text + "'. Use HOST or HOST:PORT.");
            }
            return new MasterAddress(endpoint);
        }

        /// <summary>Return the address of this computer on the route to the master, or null without a network.</summary>
        public string OwnHost()
        {
            try
            {
                IPAddress address = Endpoint.Resolve()[0];
                using (var socket = new Socket(address.AddressFamily, SocketType.Dgram, ProtocolType.Udp))
                {
                    socket.Connect(new IPEndPoint(address, Endpoint.Port)); // sends nothing
                    return ((IPEndPoint)socket.LocalEndPoint).Address.ToString();
                }
            }
            catch (SocketException)
            {
                return null;
            }
        }
    }
}
