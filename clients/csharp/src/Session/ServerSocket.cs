using System;
using System.Collections.Generic;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Call that waits for the server's callback.</summary>
    internal sealed class IncomingCall
    {
        public Connection From;
        public ServiceHeader Header;
        public byte[] Payload;
        public double? UntilS;
    }

    /// <summary>ROUTER socket of a server with its queue of calls. Thread-safe.</summary>
    internal sealed class ServerSocket : IRouterOwner, ISessionPublisher
    {
        private const int MaxWaiting = 1000;
        private const long MaxWaitingBytes = 256L << 20;

        private readonly object _lock = new object();
        private readonly Queue<IncomingCall> _waiting = new Queue<IncomingCall>();
        private readonly RouterSocket _socket;
        private readonly Bindings _bindings;
        private long _waitingBytes;
        private int _running;
        private bool _isClosing;

        public ServerSocket(PublisherRecord record)
        {
            Record = record;
            var limits = new ZmtpLimits { MaxMessageBytes = ServiceHeader.MaxPayloadBytes + 1024, MaxConnections = 1000 };
            _socket = new RouterSocket(this, limits, NullMechanism.Create);
            _bindings = new Bindings(_socket.Acceptor);
        }

        public PublisherRecord Record { get; private set; }

        public ulong LastSeq
        {
            get { return (ulong)Calls; }
        }

        public long Calls { get; private set; }

        public long Errors { get; private set; }

        public long Refused { get; private set; }

        public long Bytes { get; private set; }

        public bool Move(IList<string> hosts)
        {
            lock (_lock)
            {
                return !_isClosing && _bindings.Move(hosts, Record);
            }
        }

        public Dictionary<object, object> Statistics()
        {
            lock (_lock)
            {
                return new Dictionary<object, object>
                {
                    { "id", Record.Id }, { "count", Calls }, { "bytes", Bytes }, { "last_seq", Calls }, { "errors", Errors },
                };
            }
        }

        /// <summary>Wait for the next call that has not timed out; null if the server is closing.</summary>
        public IncomingCall Take()
        {
            lock (_lock)
            {
                while (true)
                {
                    while (_waiting.Count == 0 && !_isClosing)
                    {
                        Monitor.Wait(_lock);
                    }
                    if (_isClosing)
                    {
                        return null;
                    }
                    IncomingCall call = _waiting.Dequeue();
                    _waitingBytes -= call.Payload.Length;
                    if (call.UntilS == null || Clock.SteadyS < call.UntilS)
                    {
                        _running++;
                        return call;
                    }
                }
            }
        }

        /// <summary>Reply to a call returned by <see cref="Take"/>.</summary>
        public void Answer(IncomingCall call, byte kind, byte[] payload)
        {
            lock (_lock)
            {
                _running--;
                if (kind == ServiceHeader.Refused)
                {
                    Refused++;
                }
                else
                {
                    Calls++;
                    Bytes += payload.Length;
                    Errors += kind == ServiceHeader.Error ? 1 : 0;
                }
                Monitor.PulseAll(_lock);
            }
            Send(call, kind, payload);
        }

        public void BeginClose()
        {
            List<IncomingCall> refused;
            lock (_lock)
            {
                _isClosing = true;
                refused = new List<IncomingCall>(_waiting);
                _waiting.Clear();
                Monitor.PulseAll(_lock);
            }
            refused.ForEach(each => Refuse(each, "the server is closing"));
        }

        public void Finish(int timeoutMs)
        {
            var deadline = new Deadline(Math.Max(0, timeoutMs));
            lock (_lock)
            {
                while (_running > 0 && !deadline.IsOver)
                {
                    deadline.Wait(_lock);
                }
            }
            _socket.Acceptor.Close(deadline.LeftMs);
        }

        void IRouterOwner.Received(Connection from, byte[][] parts)
        {
            IncomingCall call;
            try
            {
                call = new IncomingCall { From = from, Header = ServiceHeader.Read(parts, true), Payload = parts[1] };
            }
            catch (WireException exception)
            {
                _socket.Acceptor.Refused.Add(exception.Code); // counted without a reply; the connection stays open
                return;
            }
            if (call.Payload.Length > ServiceHeader.MaxPayloadBytes)
            {
                throw new ZmtpException("message-too-large", "it sent a call of more than 64 MB");
            }
            if (call.Header.TimeoutMs > 0)
            {
                call.UntilS = Clock.SteadyS + call.Header.TimeoutMs / 1000.0;
            }
            string reason = null;
            lock (_lock)
            {
                if (_isClosing)
                {
                    reason = "the server is closing";
                }
                else if (_waiting.Count >= MaxWaiting || _waitingBytes + call.Payload.Length > MaxWaitingBytes)
                {
                    reason = "the server has too many pending calls";
                }
                else
                {
                    _waiting.Enqueue(call);
                    _waitingBytes += call.Payload.Length;
                    Monitor.PulseAll(_lock);
                }
            }
            if (reason != null)
            {
                Refuse(call, reason);
            }
        }

        void IRouterOwner.Left(Connection connection)
        {
        }

        private void Refuse(IncomingCall call, string reason)
        {
            lock (_lock)
            {
                Refused++;
            }
            Send(call, ServiceHeader.Refused, ServiceFailure.Encode("", reason));
        }

        private static void Send(IncomingCall call, byte kind, byte[] payload)
        {
            bool isFailure = kind != ServiceHeader.Answer;
            var header = new ServiceHeader { Kind = kind, Codec = isFailure ? (ushort)1 : call.Header.Codec, Number = call.Header.Number };
            call.From.Send(EncodedMessage.Message(header.ToBytes(), payload));
        }
    }
}
