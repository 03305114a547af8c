using System;
using System.Collections.Generic;
using System.Net.Sockets;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Addresses at which a socket is bound, each with its own port. Not thread-safe; guarded by the owner's lock.</summary>
    internal sealed class Bindings
    {
        private readonly Dictionary<string, string> _bound = new Dictionary<string, string>();
        private readonly Acceptor _acceptor;

        public Bindings(Acceptor acceptor)
        {
            _acceptor = acceptor;
        }

        /// <summary>Bind at exactly these hosts; return true if the endpoints in <paramref name="record"/> have changed.</summary>
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
                        continue; // the address no longer exists; retried within a second
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

        /// <summary>Return true if publishers may use a port, which is not one of the original NEP's.</summary>
        private static bool IsFreeForUs(int port)
        {
            return port != 7000 && port != 7777 && port != 7780 && port != 12345 && port != 50000 && (port < 9000 || port > 9999);
        }
    }
}
