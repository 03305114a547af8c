using System;
using System.Collections.Generic;
using System.Net.Sockets;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Addresses at which a socket is bound, each with a port of its own. It lives under its owner's lock.</summary>
    internal sealed class Bindings
    {
        private readonly Dictionary<string, string> _bound = new Dictionary<string, string>();
        private readonly Acceptor _acceptor;

        public Bindings(Acceptor acceptor)
        {
            _acceptor = acceptor;
        }

        /// <summary>Bind at these hosts and no others; true when the endpoints in <paramref name="record"/> changed.</summary>
        public bool Move(IList<string> hosts, PublisherRecord record)
        {
            foreach (string host in new List<string>(_bound.Keys))
            {
                if (!hosts.Contains(host))
                {
                    _acceptor.Unbind(host);
                    _bound.Remove(host);
                }
            }
            var endpoints = new List<string>();
            foreach (string host in hosts)
            {
                if (!_bound.ContainsKey(host))
                {
                    try
                    {
                        _bound[host] = ZmtpEndpoint.Format(host, _acceptor.Bind(host, IsFreeForUs));
                    }
                    catch (SocketException)
                    {
                        continue; // the address has gone; tried again within a second
                    }
                }
                endpoints.Add(_bound[host]);
            }
            if (endpoints.Count == 0 || string.Join(" ", endpoints.ToArray()) == string.Join(" ", record.Endpoints.ToArray()))
            {
                return false;
            }
            record.Endpoints = endpoints;
            return true;
        }

        /// <summary>Ports that programs of the original NEP expect to find something else on are left alone.</summary>
        private static bool IsFreeForUs(int port)
        {
            return port != 7000 && port != 7777 && port != 7780 && port != 12345 && port != 50000 && (port < 9000 || port > 9999);
        }
    }
}
