using System;
using System.Collections.Generic;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Pending call of a client.</summary>
    internal sealed class OutgoingCall
    {
        public ulong Number;
        public ServerLink Link;
        public byte Kind;
        public int Codec;
        public byte[] Payload;
    }

    /// <summary>Connection of a client to one server.</summary>
    internal sealed class ServerLink : IDealerOwner
    {
        private readonly ClientSocket _client;

        public ServerLink(ClientSocket client, RemotePublisher remote, ZmtpEndpoint endpoint)
        {
            _client = client;
            Id = remote.Publisher.Id;
            Endpoint = remote.Endpoint;
            Socket = new DealerSocket(endpoint, this, new ZmtpLimits { MaxMessageBytes = ServiceHeader.MaxPayloadBytes + 1024 }, NullMechanism.Create);
        }

        public ulong Id { get; private set; }

        public string Endpoint { get; private set; }

        public DealerSocket Socket { get; private set; }

        public bool IsConnected { get; set; }

        /// <summary>True if the server is no longer listed and receives no further calls.</summary>
        public bool IsGone { get; set; }

        void IDealerOwner.Connected()
        {
            _client.Changed(this, true);
        }

        void IDealerOwner.Received(byte[][] parts)
        {
            _client.Received(this, parts);
        }

        void IDealerOwner.Disconnected(string reason)
        {
            _client.Changed(this, false);
        }
    }

    /// <summary>Connections of a client to the servers of a service, in the order of their registration. Thread-safe.</summary>
    internal sealed class ClientSocket : ISessionSubscriber
    {
        private readonly object _lock = new object();
        private readonly List<ServerLink> _links = new List<ServerLink>();
        private readonly Dictionary<ulong, OutgoingCall> _calls = new Dictionary<ulong, OutgoingCall>();
        private readonly string _service;
        private ulong _numbers;
        private long _answered;
        private long _failed;
        private bool _isClosed;

        public ClientSocket(SubscriberRecord record, string service)
        {
            Record = record;
            _service = service;
        }

        public SubscriberRecord Record { get; private set; }

        /// <summary>Number of late and malformed replies.</summary>
        public long Late { get; private set; }

        public Dictionary<object, object> Statistics()
        {
            lock (_lock)
            {
                return new Dictionary<object, object> { { "id", Record.Id }, { "received", _answered }, { "lost", _failed } };
            }
        }

        public bool Hears(string topic)
        {
            return topic == Record.Topic;
        }

        /// <summary>Send a call and wait for its reply.</summary>
        public OutgoingCall Call(byte codec, byte[] payload, int timeoutMs, CancellationToken cancellation)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                ServerLink link;
                while ((link = FirstConnected()) == null)
                {
                    Wait(deadline, cancellation, () => new NoServerException(_service));
                }
                int leftMs = timeoutMs < 0 ? 0 : Math.Max(1, deadline.LeftMs);
                var call = new OutgoingCall { Number = ++_numbers, Link = link };
                var header = new ServiceHeader { Kind = ServiceHeader.Call, Codec = codec, TimeoutMs = (uint)leftMs, Number = call.Number };
                _calls[call.Number] = call;
                try
                {
                    if (!link.Socket.Send(header.ToBytes(), payload))
                    {
                        throw new ServerGoneException(_service);
                    }
                    while (call.Payload == null)
                    {
                        if (call.Link == null)
                        {
                            throw new ServerGoneException(_service);
                        }
                        Wait(deadline, cancellation, () => new ServiceTimeoutException(_service));
                    }
                    _answered++;
                    return call;
                }
                catch
                {
                    _failed++;
                    throw;
                }
                finally
                {
                    _calls.Remove(call.Number);
                }
            }
        }

        public void Connect(RemotePublisher remote, bool isNew)
        {
            ZmtpEndpoint endpoint;
            lock (_lock)
            {
                ServerLink known = _links.Find(each => each.Id == remote.Publisher.Id);
                bool isOurs = remote.Publisher.Codec == "service" && ZmtpEndpoint.TryParse(remote.Endpoint, out endpoint);
                if (_isClosed || !isOurs || known != null && known.Endpoint == remote.Endpoint)
                {
                    return;
                }
                if (known != null)
                {
                    Leave(known);
                }
                ZmtpEndpoint.TryParse(remote.Endpoint, out endpoint);
                var link = new ServerLink(this, remote, endpoint);
                _links.Add(link);
                link.Socket.Start();
            }
        }

        public void Gone(string topic, ulong publisher, ulong lastSeq, bool isClosed)
        {
            lock (_lock)
            {
                ServerLink link = _links.Find(each => each.Id == publisher);
                if (link != null && isClosed)
                {
                    link.IsGone = true; // replies may still arrive; the server closes the connection
                    LeaveIfIdle(link);
                }
            }
        }

        public void Reconcile(string topic, IList<RemotePublisher> remotes)
        {
            lock (_lock)
            {
                foreach (ServerLink each in new List<ServerLink>(_links))
                {
                    bool isListed = false;
                    foreach (RemotePublisher remote in remotes)
                    {
                        isListed |= remote.Publisher.Id == each.Id;
                    }
                    if (!isListed && !each.IsConnected)
                    {
                        Leave(each);
                    }
                }
                foreach (RemotePublisher each in remotes)
                {
                    Connect(each, false);
                }
            }
        }

        public void Tick(Dictionary<ulong, ulong> lastSeqs)
        {
        }

        public void Correct(Dictionary<string, ClockDifference> clocks)
        {
            // replies have no time stamps
        }

        public void Close()
        {
            List<ServerLink> links;
            lock (_lock)
            {
                _isClosed = true;
                links = new List<ServerLink>(_links);
                Monitor.PulseAll(_lock);
            }
            links.ForEach(each => each.Socket.Close(0));
        }

        /// <summary>Wake waiting threads so that they check for cancellation.</summary>
        public void Wake()
        {
            lock (_lock)
            {
                Monitor.PulseAll(_lock);
            }
        }

        internal void Changed(ServerLink link, bool isConnected)
        {
            lock (_lock)
            {
                link.IsConnected = isConnected;
                if (!isConnected)
                {
                    foreach (OutgoingCall each in _calls.Values)
                    {
                        each.Link = each.Link == link ? null : each.Link;
                    }
                    LeaveIfIdle(link);
                }
                Monitor.PulseAll(_lock);
            }
        }

        internal void Received(ServerLink link, byte[][] parts)
        {
            lock (_lock)
            {
                try
                {
                    ServiceHeader header = ServiceHeader.Read(parts, false);
                    OutgoingCall call;
                    if (!_calls.TryGetValue(header.Number, out call) || call.Link != link)
                    {
                        Late++;
                        return;
                    }
                    call.Kind = header.Kind;
                    call.Codec = header.Codec;
                    call.Payload = parts[1];
                    Monitor.PulseAll(_lock);
                }
                catch (WireException)
                {
                    Late++;
                }
            }
        }

        private ServerLink FirstConnected()
        {
            return _links.Find(each => each.IsConnected && !each.IsGone);
        }

        private void LeaveIfIdle(ServerLink link)
        {
            bool isIdle = true;
            foreach (OutgoingCall each in _calls.Values)
            {
                isIdle &= each.Link != link;
            }
            if (link.IsGone && isIdle)
            {
                Leave(link);
            }
        }

        private void Leave(ServerLink link)
        {
            _links.Remove(link);
            ThreadPool.QueueUserWorkItem(state => link.Socket.Close(0)); // Close waits for the socket's thread, which may be the caller
        }

        private void Wait(Deadline deadline, CancellationToken cancellation, Func<NepException> error)
        {
            cancellation.ThrowIfCancellationRequested();
            if (_isClosed)
            {
                throw new ObjectDisposedException("Client");
            }
            if (deadline.IsOver)
            {
                throw error();
            }
            deadline.Wait(_lock);
        }
    }
}
