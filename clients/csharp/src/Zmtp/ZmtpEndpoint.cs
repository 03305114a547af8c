using System;
using System.Globalization;
using System.Net;
using System.Net.Sockets;

namespace Nep.Zmtp
{
    /// <summary>Endpoint <c>tcp://HOST:PORT</c>; HOST is a name, an IPv4 address or an IPv6 address in brackets.</summary>
    internal sealed class ZmtpEndpoint
    {
        private const string Scheme = "tcp://";

        private ZmtpEndpoint(string host, int port)
        {
            Host = host;
            Port = port;
        }

        /// <summary>Host without brackets.</summary>
        public string Host { get; private set; }

        public int Port { get; private set; }

        public bool IsLoopback
        {
            get
            {
                IPAddress address;
                return Host == "localhost" || IPAddress.TryParse(Host, out address) && IPAddress.IsLoopback(address);
            }
        }

        public static string Format(string host, int port)
        {
            string shown = host.IndexOf(':') >= 0 ? "[" + host + "]" : host;
            return Scheme + shown + ":" + port.ToString(CultureInfo.InvariantCulture);
        }

        public static bool TryParse(string text, out ZmtpEndpoint endpoint)
        {
            endpoint = null;
            if (text == null || !text.StartsWith(Scheme, StringComparison.Ordinal))
            {
                return false;
            }
            string rest = text.Substring(Scheme.Length);
            int colon = rest.LastIndexOf(':');
            int port;
            if (colon <= 0 || !int.TryParse(rest.Substring(colon + 1), NumberStyles.None, CultureInfo.InvariantCulture, out port)
                || port < 1 || port > 65535)
            {
                return false;
            }
            string host = rest.Substring(0, colon);
            if (host.Length > 2 && host[0] == '[' && host[host.Length - 1] == ']')
            {
                host = host.Substring(1, host.Length - 2);
                IPAddress address;
                if (!IPAddress.TryParse(host, out address) || address.AddressFamily != AddressFamily.InterNetworkV6)
                {
                    return false;
                }
            }
            else if (host.IndexOf(':') >= 0 || host.IndexOf('/') >= 0 || host.Length > 253)
            {
                return false;
            }
            endpoint = new ZmtpEndpoint(host, port);
            return true;
        }

        /// <summary>Return the addresses of the host, IPv4 first.</summary>
        public IPAddress[] Resolve()
        {
            IPAddress address;
            if (IPAddress.TryParse(Host, out address))
            {
                return new[] { address };
            }
            IPAddress[] all = Dns.GetHostAddresses(Host);
            // Peers bind IPv4 addresses by default.
            Array.Sort(all, CompareFamilies);
            return all;
        }

        private static int CompareFamilies(IPAddress left, IPAddress right)
        {
            return Rank(left).CompareTo(Rank(right));
        }

        private static int Rank(IPAddress address)
        {
            return address.AddressFamily == AddressFamily.InterNetwork ? 0 : 1;
        }
    }
}
