using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>Interface of publishers and servers used by the session and the node. All methods are thread-safe.</summary>
    internal interface ISessionPublisher
    {
        PublisherRecord Record { get; }

        /// <summary>Seq of the newest message, or number of answered calls.</summary>
        ulong LastSeq { get; }

        Dictionary<object, object> Statistics();

        /// <summary>Bind at exactly these addresses; return true if the endpoints of the record have changed.</summary>
        bool Move(IList<string> hosts);

        /// <summary>Start to close: send byes to subscribers, or reject calls.</summary>
        void BeginClose();

        /// <summary>Wait until peers have received everything or the timeout expires, and close the socket.</summary>
        void Finish(int timeoutMs);
    }

    /// <summary>Interface of subscribers and clients used by the session and the node. All methods are thread-safe.</summary>
    internal interface ISessionSubscriber
    {
        SubscriberRecord Record { get; }

        Dictionary<object, object> Statistics();

        /// <summary>Connect to a publisher, unless connected already.</summary>
        /// <param name="remote">Publisher listed by the master.</param>
        /// <param name="isNew">True if it was created after this subscriber was registered: losses count from its first message.</param>
        void Connect(RemotePublisher remote, bool isNew);

        /// <summary>Return true if it subscribes to a topic.</summary>
        bool Hears(string topic);

        /// <summary>Handle that a publisher is no longer listed.</summary>
        void Gone(string topic, ulong publisher, ulong lastSeq, bool isClosed);

        /// <summary>Handle the complete list of the publishers of a topic; null for all topics of the subscriber.</summary>
        void Reconcile(string topic, IList<RemotePublisher> remotes);

        /// <summary>Called after each renewal with the seqs of the publishers' newest messages, as known to the master.</summary>
        void Tick(Dictionary<ulong, ulong> lastSeqs);

        /// <summary>Set the clock differences to other computers, by node, replacing all previous ones.</summary>
        void Correct(Dictionary<string, ClockDifference> clocks);

        void Close();
    }

    /// <summary>Registration of a node with one master: renews the lease, rejoins, and handles pushed changes.</summary>
    internal sealed class MasterSession : IDealerOwner
    {
        private const int JoinAgainMs = 500;
        private const double MinRenewS = 1.0;
        private const double MaxRenewS = 30.0;

        private readonly object _lock = new object();
        private readonly NodeRecord _node;
        private readonly MasterAddress _address;
        private readonly DealerSocket _socket;
        private readonly Dictionary<ulong, ISessionPublisher> _publishers = new Dictionary<ulong, ISessionPublisher>();
        private readonly Dictionary<ulong, ISessionSubscriber> _subscribers = new Dictionary<ulong, ISessionSubscriber>();
        private readonly HashSet<ulong> _confirmed = new HashSet<ulong>();
        private readonly MasterCalls _calls;
        private readonly MasterClock _masterClock = new MasterClock();
        private bool _hasClocks;
        private readonly Stopwatch _clock = Stopwatch.StartNew();
        private List<string> _served = new List<string>();
        private string _ownHost = MasterAddress.Loopback;
        private ulong _epoch;
        private ulong _revision;
        private double _renewS = MinRenewS;
        private double _dueAtS;
        private double _joinAgainAtS;
        private volatile bool _isProblemReported;
        private string _lastProblem;
        private bool _isLeaving;
        private bool _isClosed;

        public MasterSession(NodeRecord node, MasterAddress address)
        {
            _node = node;
            _address = address;
            var limits = new ZmtpLimits { MaxMessageBytes = 256L << 20, MaxReconnectMs = 400, HeartbeatMs = 1000, HeartbeatTimeoutMs = 3000 };
            _socket = new DealerSocket(address.Endpoint, this, limits, NullMechanism.Create);
            _calls = new MasterCalls(address.ToString(), _socket);
            _socket.Start();
            BackgroundThread.Start("node", Run, BackgroundThread.SmallStackBytes);
        }

        /// <summary>Return the addresses of this computer at which publishers must be reachable.</summary>
        public IList<string> Hosts()
        {
            var hosts = new List<string>();
            lock (_lock)
            {
                if (_address.IsNear)
                {
                    hosts.Add(MasterAddress.Loopback);
                    hosts.AddRange(_served);
                    return hosts;
                }
            }
            string own = _address.OwnHost();
            lock (_lock)
            {
                _ownHost = own ?? _ownHost;
                hosts.Add(_ownHost);
            }
            return hosts;
        }

        /// <summary>Register a publisher and return the expected subscribers.</summary>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        public List<ExpectedSubscriber> AddPublisher(ISessionPublisher publisher, int timeoutMs)
        {
            ulong id = publisher.Record.Id;
            lock (_lock)
            {
                _publishers[id] = publisher;
            }
            var expected = new List<ExpectedSubscriber>();
            try
            {
                do
                {
                    var what = new Dictionary<object, object> { { "node", _node.ToMap() }, { "publisher", publisher.Record.ToMap() } };
                    _calls.Ask("publisher+", what, timeoutMs, reply =>
                    {
                        expected.AddRange(ExpectedSubscriber.ReadAll(reply.List("expected")));
                        lock (_lock)
                        {
                            _confirmed.Add(id);
                        }
                    });
                }
                while (publisher.Move(Hosts())); // the reply may contain new addresses that the master serves
            }
            catch
            {
                RemovePublisher(id, 0);
                throw;
            }
            return expected;
        }

        /// <summary>Register a subscriber; it is connected to the publishers there are before this returns.</summary>
        /// <exception cref="MasterUnreachableException">No master replied before the timeout.</exception>
        public void AddSubscriber(ISessionSubscriber subscriber, int timeoutMs)
        {
            ulong id = subscriber.Record.Id;
            lock (_lock)
            {
                _subscribers[id] = subscriber;
            }
            var what = new Dictionary<object, object> { { "node", _node.ToMap() }, { "subscriber", subscriber.Record.ToMap() } };
            try
            {
                _calls.Ask("subscriber+", what, timeoutMs, reply =>
                {
                    lock (_lock)
                    {
                        _confirmed.Add(id);
                    }
                    foreach (RemotePublisher remote in ReadRemotes(reply.List("publishers")))
                    {
                        subscriber.Connect(remote, false);
                    }
                });
            }
            catch
            {
                RemoveSubscriber(id);
                throw;
            }
        }

        public void RemovePublisher(ulong id, ulong lastSeq)
        {
            if (Forget(_publishers, id))
            {
                _calls.Tell("publisher-", new Dictionary<object, object> { { "node_id", _node.Id }, { "id", id }, { "last_seq", lastSeq } }, null);
            }
        }

        public void RemoveSubscriber(ulong id)
        {
            if (Forget(_subscribers, id))
            {
                _calls.Tell("subscriber-", new Dictionary<object, object> { { "node_id", _node.Id }, { "id", id } }, null);
            }
        }

        private bool Forget<T>(Dictionary<ulong, T> owned, ulong id)
        {
            lock (_lock)
            {
                _confirmed.Remove(id);
                return owned.Remove(id);
            }
        }

        public void ReportMissing(ulong publisher, List<ulong> subscribers)
        {
            _calls.Tell("missing", new Dictionary<object, object> { { "node_id", _node.Id }, { "publisher_id", publisher }, { "subscriber_ids", subscribers } }, null);
        }

        /// <summary>Renew once more before the node is unregistered by <see cref="Close"/>.</summary>
        public void BeginLeave()
        {
            lock (_lock)
            {
                if (_isLeaving)
                {
                    return;
                }
                _isLeaving = true;
            }
            Renew(); // reports the last seqs to subscribers that don't receive the bye
        }

        public void Close(int timeoutMs)
        {
            lock (_lock)
            {
                _isLeaving = true;
                _publishers.Clear();
                _subscribers.Clear();
                _confirmed.Clear();
            }
            if (_calls.IsConnected && _epoch != 0)
            {
                try
                {
                    _calls.Ask("leave", new Dictionary<object, object> { { "node_id", _node.Id } }, timeoutMs, null);
                }
                catch (NepException)
                {
                    // The master will detect that the connection has ended.
                }
            }
            lock (_lock)
            {
                _isClosed = true;
                Monitor.PulseAll(_lock);
            }
            _calls.Close();
            _socket.Close(0);
        }

        // ---- in the socket's thread

        void IDealerOwner.Connected()
        {
            lock (_lock)
            {
                _calls.IsConnected = true;
                _dueAtS = 0.0; // a node renews as soon as its connection is back
                Monitor.PulseAll(_lock);
            }
        }

        void IDealerOwner.Disconnected(string reason)
        {
            lock (_lock)
            {
                _calls.IsConnected = false;
            }
        }

        void IDealerOwner.Received(byte[][] parts)
        {
            try
            {
                Fields envelope = Fields.Of(new ArraySegment<byte>(parts[parts.Length - 1]));
                Obey(envelope.Text("is", null), (long)envelope.Unsigned("re", 0), envelope.Map("what"));
            }
            catch (WireException)
            {
                _socket.Refused.Add("answer");
            }
        }

        private void Obey(string name, long number, Fields what)
        {
            _isProblemReported = false;
            ulong epoch = what.Unsigned("epoch", 0);
            bool isRegistration = name == "added" || name == "found";
            if (isRegistration || name == "renewed")
            {
                TakeHosts(what.Texts("hosts"));
            }
            lock (_lock)
            {
                _epoch = isRegistration && _epoch == 0 ? epoch : _epoch;
            }
            if (number > 0)
            {
                _calls.Complete(number, name, what);
            }
            else if (name == "publisher+")
            {
                RemotePublisher remote = RemotePublisher.Read(what.Map("publisher"), _address);
                bool isNew = what.Flag("is_new");
                EachSubscriberOf(remote.Publisher.Topic, each => each.Connect(remote, isNew && IsConfirmed(each.Record.Id)));
            }
            else if (name == "publisher-")
            {
                ulong id = what.Unsigned("id", 0), lastSeq = what.Unsigned("last_seq", 0);
                bool isClosed = what.Flag("is_closed");
                string topic = what.Text("topic", null);
                EachSubscriberOf(topic, each => each.Gone(topic, id, lastSeq, isClosed));
            }
            if (_epoch != 0 && epoch != _epoch)
            {
                Join();
            }
        }

        private void TakeHosts(List<string> hosts)
        {
            lock (_lock)
            {
                if (string.Join(" ", hosts.ToArray()) != string.Join(" ", _served.ToArray()))
                {
                    _served = hosts;
                    _dueAtS = 0.0;
                    Monitor.PulseAll(_lock);
                }
            }
        }

        private List<RemotePublisher> ReadRemotes(List<object> list)
        {
            var remotes = new List<RemotePublisher>();
            foreach (object each in list)
            {
                remotes.Add(RemotePublisher.Read(new Fields(each), _address));
            }
            return remotes;
        }

        private void EachSubscriberOf(string topic, Action<ISessionSubscriber> action)
        {
            foreach (ISessionSubscriber each in Subscribers())
            {
                if (each.Hears(topic))
                {
                    action(each);
                }
            }
        }

        /// <summary>Return true if the master has confirmed the registration of a publisher or subscriber.</summary>
        private bool IsConfirmed(ulong id)
        {
            lock (_lock)
            {
                return _confirmed.Contains(id);
            }
        }

        private List<ISessionSubscriber> Subscribers()
        {
            lock (_lock)
            {
                return new List<ISessionSubscriber>(_subscribers.Values);
            }
        }

        private List<ISessionPublisher> Publishers()
        {
            lock (_lock)
            {
                return new List<ISessionPublisher>(_publishers.Values);
            }
        }

        // ---- renewing and joining

        private void Run()
        {
            double followAtS = 0.0;
            while (true)
            {
                bool isDue;
                lock (_lock)
                {
                    double now = _clock.Elapsed.TotalSeconds;
                    double waitS = Math.Min(_dueAtS, followAtS) - now;
                    if (!_isClosed && waitS > 0)
                    {
                        Monitor.Wait(_lock, (int)(waitS * 1000) + 1);
                    }
                    if (_isClosed)
                    {
                        return;
                    }
                    now = _clock.Elapsed.TotalSeconds;
                    isDue = now >= _dueAtS;
                    if (isDue)
                    {
                        _dueAtS = now + _renewS;
                    }
                }
                followAtS = _clock.Elapsed.TotalSeconds + 1.0;
                FollowAddresses();
                ReportProblem();
                if (isDue && !_isLeaving)
                {
                    Renew();
                }
            }
        }

        /// <summary>Log once that another program uses the master's address, and again only after a master has replied.</summary>
        private void ReportProblem()
        {
            string problem = _socket.Problem;
            bool isSteady = problem != null && problem == _lastProblem; // an exiting master closes connections, too
            _lastProblem = problem;
            if (isSteady && !_isProblemReported)
            {
                _isProblemReported = true;
                Log.Warning("The program at the master's address " + _address + " isn't a master (" + problem + "). Retrying until a master is there.");
            }
        }

        private void FollowAddresses()
        {
            List<ISessionPublisher> publishers = Publishers();
            if (publishers.Count == 0)
            {
                return;
            }
            IList<string> hosts = Hosts();
            foreach (ISessionPublisher each in publishers)
            {
                if (IsConfirmed(each.Record.Id) && each.Move(hosts))
                {
                    _calls.Tell("publisher+", new Dictionary<object, object> { { "node", _node.ToMap() }, { "publisher", each.Record.ToMap() } }, null);
                }
            }
        }

        private void Renew()
        {
            ulong epoch, revision;
            List<ISessionPublisher> publishers;
            List<ISessionSubscriber> subscribers;
            lock (_lock)
            {
                epoch = _epoch;
                revision = _revision;
                publishers = Publishers().FindAll(each => _confirmed.Contains(each.Record.Id));
                subscribers = Subscribers().FindAll(each => _confirmed.Contains(each.Record.Id));
            }
            if (epoch == 0)
            {
                return;
            }
            List<object> clock = _masterClock.Field();
            Moment sent = _masterClock.Now();
            if (clock.Count == 0)
            {
                Correct(new Dictionary<string, ClockDifference>()); // also after this computer's clock was set
            }
            var what = new Dictionary<object, object>
            {
                { "node_id", _node.Id }, { "epoch", epoch }, { "revision", revision }, { "clock", clock },
                { "publishers", publishers.ConvertAll(each => (object)each.Statistics()) },
                { "subscribers", subscribers.ConvertAll(each => (object)each.Statistics()) },
            };
            _calls.Tell("renew", what, answer => Renewed(answer, sent));
        }

        private void Renewed(Fields answer, Moment sent)
        {
            Moment received = _masterClock.Now();
            if (answer.Flag("again"))
            {
                Join();
                return;
            }
            lock (_lock)
            {
                _revision = answer.Unsigned("revision", 0);
                _renewS = Math.Min(MaxRenewS, Math.Max(MinRenewS, answer.Number("next_s", MinRenewS)));
                _dueAtS = _clock.Elapsed.TotalSeconds + _renewS;
            }
            foreach (object each in answer.List("topics"))
            {
                var topic = new Fields(each);
                List<RemotePublisher> remotes = ReadRemotes(topic.List("publishers"));
                string name = topic.Text("topic", null);
                EachSubscriberOf(name, subscriber => subscriber.Reconcile(name, remotes));
            }
            Correct(MasterClock.DifferencesIn(answer));
            Dictionary<ulong, ulong> lastSeqs = answer.Numbers("last_seqs");
            foreach (ISessionSubscriber each in Subscribers())
            {
                each.Tick(lastSeqs);
            }
            if (answer.Unsigned("epoch", 0) == _epoch && _masterClock.Compare(answer, sent, received))
            {
                lock (_lock)
                {
                    _dueAtS = 0.0; // other nodes need the offset
                    Monitor.PulseAll(_lock);
                }
            }
        }

        private void Correct(Dictionary<string, ClockDifference> clocks)
        {
            if (clocks.Count > 0 || _hasClocks)
            {
                _hasClocks = clocks.Count > 0;
                Subscribers().ForEach(each => each.Correct(clocks));
            }
        }

        private void Join()
        {
            List<ISessionPublisher> publishers = Publishers();
            List<ISessionSubscriber> subscribers = Subscribers();
            lock (_lock)
            {
                double now = _clock.Elapsed.TotalSeconds;
                if (_isLeaving || now < _joinAgainAtS)
                {
                    return;
                }
                _joinAgainAtS = now + JoinAgainMs / 1000.0;
                _renewS = MinRenewS;
            }
            var what = new Dictionary<object, object>
            {
                { "node", _node.ToMap() }, { "epoch", _epoch },
                { "publishers", publishers.ConvertAll(each => (object)each.Record.ToMap()) },
                { "subscribers", subscribers.ConvertAll(each => (object)each.Record.ToMap()) },
            };
            _calls.Tell("join", what, reply => Joined(reply, publishers, subscribers));
        }

        private void Joined(Fields reply, List<ISessionPublisher> publishers, List<ISessionSubscriber> subscribers)
        {
            _masterClock.Forget(); // the master may be on another computer now
            lock (_lock)
            {
                _epoch = reply.Unsigned("epoch", 0);
                _revision = reply.Unsigned("revision", 0);
                _joinAgainAtS = 0.0;
                _confirmed.Clear();
                foreach (ISessionPublisher each in publishers)
                {
                    _confirmed.Add(each.Record.Id);
                }
                foreach (ISessionSubscriber each in subscribers)
                {
                    _confirmed.Add(each.Record.Id);
                }
            }
            List<RemotePublisher> remotes = ReadRemotes(reply.List("publishers"));
            foreach (ISessionSubscriber each in subscribers)
            {
                each.Reconcile(null, remotes.FindAll(remote => each.Hears(remote.Publisher.Topic)));
            }
        }
    }
}
