using System;
using System.Collections.Generic;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>SUB socket of a subscriber, which fills an inbox. Thread-safe.</summary>
    internal sealed class SubscriberSocket : ISubOwner, ISubscriberSocket
    {
        private const int MaxClosedEarly = 1000;

        private readonly object _lock = new object();
        private readonly SubSocket _socket;
        private readonly HeardPublishers _sources = new HeardPublishers();
        private readonly HashSet<ulong> _closedEarly = new HashSet<ulong>();
        private readonly bool _ownsInbox;
        private readonly byte[] _topic;
        private readonly byte[] _hello;
        private long _rejected;
        private string _rejection = "";
        private double _rejectedAtS;
        private bool _isClosed;

        public SubscriberSocket(SubscriberRecord record, Inbox inbox, bool ownsInbox)
        {
            Record = record;
            Inbox = inbox;
            _ownsInbox = ownsInbox;
            _topic = Names.TopicPart(record.Topic);
            _hello = Filters.Hello(record.Id, record.Topic, 3);
            _socket = new SubSocket(this, new ZmtpLimits(), NullMechanism.Create);
            _socket.Subscribe(_topic);
            _socket.Subscribe(_hello);
        }

        public Inbox Inbox { get; private set; }

        public SubscriberRecord Record { get; private set; }

        public long Received
        {
            get { lock (_lock) { return _sources.Received; } }
        }

        public long Lost
        {
            get { lock (_lock) { return _sources.Lost; } }
        }

        public long Rejected
        {
            get { lock (_lock) { return _rejected; } }
        }

        public bool HasPublishers
        {
            get { lock (_lock) { return _sources.All.Count > 0; } }
        }

        public bool Hears(string topic)
        {
            return topic == Record.Topic;
        }

        /// <summary>Wait until the echoes of all listed publishers were received.</summary>
        public void WaitForEchoes(int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                while (!AllHaveEchoed() && !deadline.IsOver)
                {
                    deadline.Wait(_lock);
                }
            }
        }

        public Dictionary<object, object> Statistics()
        {
            lock (_lock)
            {
                var statistics = new Dictionary<object, object> { { "id", Record.Id }, { "received", Math.Max(0, _sources.Received) }, { "lost", Math.Max(0, _sources.Lost) } };
                string problem = ConnectionProblem();
                if (_rejected > 0 && Clock.SteadyS < _rejectedAtS + 5.0)
                {
                    statistics["problem"] = "a message was rejected: " + _rejection + " (" + _rejected + " so far)";
                }
                else if (problem != null)
                {
                    statistics["problem"] = problem;
                }
                return statistics;
            }
        }

        public void Connect(RemotePublisher remote, bool isNew)
        {
            lock (_lock)
            {
                if (_isClosed || _closedEarly.Contains(remote.Publisher.Id))
                {
                    return;
                }
                foreach (ulong old in _sources.ReplacedBy(remote))
                {
                    _sources.Closing(old, 0);
                }
                LeaveOthersAt(remote);
                HeardPublisher source = _sources.Listed(remote);
                if (isNew && remote.Endpoint != null)
                {
                    _sources.ExpectAllOf(remote.Publisher.Id);
                }
                if (remote.Endpoint == null || source.Connection != null && source.Connection.Endpoint == remote.Endpoint)
                {
                    return;
                }
                if (source.Connection != null)
                {
                    _socket.Disconnect(source.Connection);
                    source.HasEchoed = false;
                }
                source.Connection = _socket.Connect(remote.Endpoint, null);
            }
        }

        public void Gone(string topic, ulong publisher, ulong lastSeq, bool isClosed)
        {
            lock (_lock)
            {
                if (!isClosed)
                {
                    _sources.Lapsed(publisher, lastSeq);
                }
                else if (_sources.Find(publisher) != null)
                {
                    _sources.Closing(publisher, lastSeq);
                }
                else
                {
                    if (_closedEarly.Count >= MaxClosedEarly)
                    {
                        _closedEarly.Clear();
                    }
                    _closedEarly.Add(publisher); // a later reply may still list it
                }
            }
        }

        public void Reconcile(string topic, IList<RemotePublisher> remotes)
        {
            lock (_lock)
            {
                var listed = new HashSet<ulong>();
                foreach (RemotePublisher each in remotes)
                {
                    listed.Add(each.Publisher.Id);
                }
                foreach (KeyValuePair<ulong, HeardPublisher> each in _sources.All)
                {
                    if (each.Value.Remote != null && !listed.Contains(each.Key) && each.Value.EndsAtS == null)
                    {
                        each.Value.IsLapsed = true;
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
            lock (_lock)
            {
                foreach (KeyValuePair<ulong, ulong> each in lastSeqs)
                {
                    _sources.PromisedBy(each.Key, each.Value);
                }
                foreach (ulong each in _sources.Ended())
                {
                    _sources.Settle(each);
                    Leave(each);
                }
            }
        }

        public void Correct(Dictionary<string, ClockDifference> clocks)
        {
            lock (_lock)
            {
                _sources.Correct(clocks);
            }
        }

        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                _socket.Dispose();
                Monitor.PulseAll(_lock);
            }
            if (_ownsInbox)
            {
                Inbox.Close();
            }
        }

        // ---- in the connections' threads

        void ISubOwner.Received(SubConnection from, byte[][] parts)
        {
            lock (_lock)
            {
                if (_isClosed)
                {
                    return;
                }
                try
                {
                    Take(from, parts);
                }
                catch (WireException exception)
                {
                    _rejected++;
                    _rejection = exception.Code;
                    _rejectedAtS = Clock.SteadyS;
                }
                Monitor.PulseAll(_lock);
            }
        }

        void ISubOwner.Disconnected(SubConnection from, string reason)
        {
        }

        private void Take(SubConnection from, byte[][] parts)
        {
            bool isAlone = parts.Length > 1 && ByteOrder.Instance.Equals(parts[0], _hello);
            int cut = isAlone ? 0 : WireReader.CheckFirst(parts);
            if (!isAlone && (cut != _topic.Length || !ByteOrder.StartsWith(parts[0], _topic)))
            {
                throw new WireException("first-part");
            }
            if (isAlone && parts.Length == 2)
            {
                TakeNotice(from, Header.Read(parts[1], 0, parts[1].Length));
                return;
            }
            foreach (WireMessage each in WireReader.ReadRest(Record.Topic, parts, cut))
            {
                Take(each, isAlone);
            }
        }

        private void Take(WireMessage message, bool isAlone)
        {
            ulong publisher = message.Header.Publisher;
            if (!isAlone && _sources.IsEarly(publisher) || !_sources.Arrived(publisher, message.Header.Seq, isAlone))
            {
                return;
            }
            if ((message.Header.Flags & Header.Shared) != 0)
            {
                _sources.Dropped(1);
                throw new WireException("shared-memory"); // this library accepts no offers
            }
            HeardPublisher source = _sources.Get(publisher);
            string type = source.Remote == null ? Record.MsgType : source.Remote.Publisher.MsgType;
            _sources.Dropped(Inbox.Put(new Message(message, type, source.Clock)));
        }

        private void TakeNotice(SubConnection from, Header header)
        {
            HeardPublisher source = _sources.Get(header.Publisher);
            bool isPossible = _sources.Reached(header.Publisher, header.Seq);
            if ((header.Flags & Header.Bye) != 0)
            {
                Leave(header.Publisher);
            }
            else if ((header.Flags & Header.Offer) == 0)
            {
                if (source.HasEchoed)
                {
                    ulong bound = (ulong)(SendWindow.MaxBytes / Math.Max(1, _sources.EchoingCount()));
                    _socket.Signal(from, Filters.Read(new ReadAnswer { Subscriber = Record.Id, Publisher = header.Publisher, Seq = header.Seq, BoundBytes = bound }));
                }
                source.HasEchoed = true;
            }
            if (!isPossible)
            {
                throw new WireException("seq-leap");
            }
        }

        private string ConnectionProblem()
        {
            foreach (KeyValuePair<ulong, HeardPublisher> each in _sources.All)
            {
                SubConnection connection = each.Value.IsLapsed ? null : each.Value.Connection;
                string problem = connection == null ? null : connection.Problem;
                if (problem != null)
                {
                    return "the program at " + connection.Endpoint + " isn't a publisher (" + problem + ")";
                }
            }
            return null;
        }

        private bool AllHaveEchoed()
        {
            foreach (KeyValuePair<ulong, HeardPublisher> each in _sources.All)
            {
                if (each.Value.Connection != null && !each.Value.HasEchoed && !each.Value.IsLapsed)
                {
                    return false;
                }
            }
            return true;
        }

        private void LeaveOthersAt(RemotePublisher remote)
        {
            var others = new List<ulong>();
            foreach (KeyValuePair<ulong, HeardPublisher> each in _sources.All)
            {
                if (each.Key != remote.Publisher.Id && remote.Endpoint != null && each.Value.Connection != null
                    && each.Value.Connection.Endpoint == remote.Endpoint)
                {
                    others.Add(each.Key);
                }
            }
            foreach (ulong each in others)
            {
                _sources.Settle(each);
                Leave(each);
            }
        }

        private void Leave(ulong publisher)
        {
            HeardPublisher source = _sources.Remove(publisher);
            if (source != null && source.Connection != null)
            {
                _socket.Disconnect(source.Connection);
            }
        }
    }
}
