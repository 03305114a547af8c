using System;
using System.Collections.Generic;
using System.Threading;

namespace Nep.Session
{
    /// <summary>Interface of sockets used by the public subscriber.</summary>
    internal interface ISubscriberSocket : ISessionSubscriber
    {
        Inbox Inbox { get; }

        long Received { get; }

        long Lost { get; }

        long Rejected { get; }

        /// <summary>Wait until the echoes of all listed publishers were received.</summary>
        void WaitForEchoes(int timeoutMs);
    }

    /// <summary>Subscriber of all topics that match a pattern: one member per topic, one inbox. Thread-safe.</summary>
    internal sealed class PatternSocket : ISubscriberSocket
    {
        private const int MaxMembers = 2000;

        private readonly object _lock = new object();
        private readonly Dictionary<string, SubscriberSocket> _members = new Dictionary<string, SubscriberSocket>();
        private long _goneReceived;
        private long _goneLost;
        private long _goneRejected;
        private bool _isClosed;

        public PatternSocket(SubscriberRecord record, SubscriberOptions options)
        {
            Record = record;
            Inbox = new Inbox(options);
        }

        public SubscriberRecord Record { get; private set; }

        public Inbox Inbox { get; private set; }

        public long Received
        {
            get { return Interlocked.Read(ref _goneReceived) + Sum(each => each.Received); }
        }

        public long Lost
        {
            get { return Interlocked.Read(ref _goneLost) + Sum(each => each.Lost); }
        }

        public long Rejected
        {
            get { return Interlocked.Read(ref _goneRejected) + Sum(each => each.Rejected); }
        }

        public Dictionary<object, object> Statistics()
        {
            var statistics = new Dictionary<object, object>
            {
                { "id", Record.Id }, { "received", Math.Max(0, Received) }, { "lost", Math.Max(0, Lost) },
            };
            foreach (SubscriberSocket each in Members())
            {
                object problem;
                if (each.Statistics().TryGetValue("problem", out problem))
                {
                    statistics["problem"] = problem;
                }
            }
            return statistics;
        }

        public bool Hears(string topic)
        {
            return TopicPattern.Matches(Record.Topic, topic);
        }

        public void Connect(RemotePublisher remote, bool isNew)
        {
            SubscriberSocket member = MemberOf(remote.Publisher.Topic, true);
            if (member != null)
            {
                member.Connect(remote, isNew);
            }
        }

        public void Gone(string topic, ulong publisher, ulong lastSeq, bool isClosed)
        {
            SubscriberSocket member = MemberOf(topic, isClosed); // remembers the closed publisher, which a later reply may still list
            if (member != null)
            {
                member.Gone(topic, publisher, lastSeq, isClosed);
            }
        }

        public void Reconcile(string topic, IList<RemotePublisher> remotes)
        {
            var byTopic = new Dictionary<string, List<RemotePublisher>>();
            if (topic != null)
            {
                byTopic[topic] = new List<RemotePublisher>();
            }
            else
            {
                Members().ForEach(each => byTopic[each.Record.Topic] = new List<RemotePublisher>());
            }
            foreach (RemotePublisher each in remotes)
            {
                if (!byTopic.ContainsKey(each.Publisher.Topic))
                {
                    byTopic[each.Publisher.Topic] = new List<RemotePublisher>();
                }
                byTopic[each.Publisher.Topic].Add(each);
            }
            foreach (KeyValuePair<string, List<RemotePublisher>> each in byTopic)
            {
                SubscriberSocket member = MemberOf(each.Key, each.Value.Count > 0);
                if (member != null)
                {
                    member.Reconcile(each.Key, each.Value);
                }
            }
        }

        public void Tick(Dictionary<ulong, ulong> lastSeqs)
        {
            foreach (SubscriberSocket each in Members())
            {
                each.Tick(lastSeqs);
                if (!each.HasPublishers)
                {
                    Leave(each);
                }
            }
        }

        public void WaitForEchoes(int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            Members().ForEach(each => each.WaitForEchoes(deadline.LeftMs));
        }

        public void Correct(Dictionary<string, ClockDifference> clocks)
        {
            Members().ForEach(each => each.Correct(clocks));
        }

        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
            }
            Members().ForEach(each => each.Close());
            Inbox.Close();
        }

        /// <summary>Remove the member of a topic without publishers; its counters are retained.</summary>
        private void Leave(SubscriberSocket member)
        {
            lock (_lock)
            {
                _members.Remove(member.Record.Topic);
                _goneReceived += member.Received;
                _goneLost += member.Lost;
                _goneRejected += member.Rejected;
            }
            member.Close();
        }

        private long Sum(Func<SubscriberSocket, long> count)
        {
            long sum = 0;
            Members().ForEach(each => sum += count(each));
            return sum;
        }

        private List<SubscriberSocket> Members()
        {
            lock (_lock)
            {
                return new List<SubscriberSocket>(_members.Values);
            }
        }

        private SubscriberSocket MemberOf(string topic, bool isWanted)
        {
            lock (_lock)
            {
                SubscriberSocket member;
                if (!_members.TryGetValue(topic, out member) && isWanted && !_isClosed && _members.Count < MaxMembers && Wire.Names.IsTopic(topic))
                {
                    var record = new SubscriberRecord { Id = Record.Id, Topic = topic, MsgType = Record.MsgType };
                    _members[topic] = member = new SubscriberSocket(record, Inbox, false);
                }
                return member;
            }
        }
    }

    /// <summary>Topics with the wildcards <c>*</c> (one level) and <c>**</c> (any number of levels).</summary>
    internal static class TopicPattern
    {
        public static bool IsPattern(string topic)
        {
            return Array.Exists(topic.Split('/'), each => each == "*" || each == "**");
        }

        public static bool Matches(string pattern, string topic)
        {
            string[] parts = pattern.Split('/'), levels = topic.Split('/');
            // reached[i]: the levels so far match the first i parts
            var reached = new bool[parts.Length + 1];
            reached[0] = true;
            SkipAny(parts, reached);
            foreach (string level in levels)
            {
                var next = new bool[parts.Length + 1];
                for (int i = 0; i < parts.Length; i++)
                {
                    if (reached[i] && parts[i] == "**")
                    {
                        next[i] = true;
                    }
                    else if (reached[i] && (parts[i] == level || parts[i] == "*" && level.Length > 0))
                    {
                        next[i + 1] = true;
                    }
                }
                reached = next;
                SkipAny(parts, reached);
            }
            return reached[parts.Length];
        }

        private static void SkipAny(string[] parts, bool[] reached)
        {
            for (int i = 0; i < parts.Length; i++)
            {
                reached[i + 1] |= reached[i] && parts[i] == "**";
            }
        }
    }
}
