using System;
using System.Collections.Generic;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>State of one publisher of a subscriber.</summary>
    internal sealed class HeardPublisher
    {
        public RemotePublisher Remote;
        public SubConnection Connection;

        /// <summary>Clock of the publisher's computer, shared by its messages.</summary>
        public readonly PublisherClock Clock = new PublisherClock();

        /// <summary>Seq of the newest message, received or lost; null while unknown, 0 if no message has been sent yet.</summary>
        public ulong? Last;

        /// <summary>True if a message, an echo or a bye was received.</summary>
        public bool IsHeard;

        public bool HasEchoed;
        public bool IsLapsed;
        public double? EndsAtS;
        public double? EarlyUntilS;
        public ulong Promised;
        public ulong LateFrom;
        public ulong LateTo;
        public ulong LeaptTo;
    }

    /// <summary>Publishers of a subscriber and the number of their lost messages. Not thread-safe; guarded by the subscriber's lock.</summary>
    internal sealed class HeardPublishers
    {
        private const double FarewellS = 3.0;
        private const double EarlyS = 5.0;
        private const ulong MaxGap = 1UL << 32;
        private const int MaxUnlisted = 1000;

        private readonly Dictionary<ulong, HeardPublisher> _byId = new Dictionary<ulong, HeardPublisher>();
        private Dictionary<string, ClockDifference> _clocks = new Dictionary<string, ClockDifference>();
        private readonly LinkedList<ulong> _unlisted = new LinkedList<ulong>();

        public long Received { get; private set; }

        public long Lost { get; private set; }

        public ICollection<KeyValuePair<ulong, HeardPublisher>> All
        {
            get { return _byId; }
        }

        public HeardPublisher Find(ulong publisher)
        {
            HeardPublisher found;
            return _byId.TryGetValue(publisher, out found) ? found : null;
        }

        public HeardPublisher Get(ulong publisher)
        {
            HeardPublisher found = Find(publisher);
            if (found == null)
            {
                _byId[publisher] = found = new HeardPublisher();
                _unlisted.AddLast(publisher);
                if (_unlisted.Count > MaxUnlisted)
                {
                    Remove(_unlisted.First.Value);
                }
            }
            return found;
        }

        public HeardPublisher Listed(RemotePublisher remote)
        {
            HeardPublisher source = Get(remote.Publisher.Id);
            source.Remote = remote;
            source.Clock.Difference = DifferenceOf(remote);
            source.IsLapsed = false;
            source.EndsAtS = null;
            _unlisted.Remove(remote.Publisher.Id);
            return source;
        }

        /// <summary>Count losses from the first message of a new publisher. No effect after its first message.</summary>
        public void ExpectAllOf(ulong publisher)
        {
            HeardPublisher source = Get(publisher);
            source.Last = source.Last ?? 0;
        }

        /// <summary>Set the clock differences to other nodes, replacing all previous ones.</summary>
        public void Correct(Dictionary<string, ClockDifference> clocks)
        {
            _clocks = clocks;
            foreach (HeardPublisher each in _byId.Values)
            {
                if (each.Remote != null)
                {
                    each.Clock.Difference = DifferenceOf(each.Remote);
                }
            }
        }

        private ClockDifference DifferenceOf(RemotePublisher remote)
        {
            ClockDifference known;
            return remote.IsHere ? ClockDifference.Same : remote.NodeId != null && _clocks.TryGetValue(remote.NodeId, out known) ? known : null;
        }

        public HeardPublisher Remove(ulong publisher)
        {
            HeardPublisher found = Find(publisher);
            _byId.Remove(publisher);
            _unlisted.Remove(publisher);
            return found;
        }

        /// <summary>Count a message; return false if it is a duplicate.</summary>
        /// <exception cref="WireException">The gap before the message is too large.</exception>
        public bool Arrived(ulong publisher, ulong seq, bool isAlone)
        {
            HeardPublisher source = Get(publisher);
            source.IsHeard = true;
            if (source.Last == null)
            {
                source.Last = seq;
                Received++;
                return true;
            }
            ulong last = source.Last.Value;
            if (seq > last && seq - last > MaxGap)
            {
                if (source.LeaptTo == 0 || source.LeaptTo != seq - 1)
                {
                    source.LeaptTo = seq;
                    throw new WireException("seq-leap");
                }
                source.LeaptTo = source.Promised = 0;
                source.Last = seq;
            }
            else if (seq > last)
            {
                Lost += (long)(seq - last - 1);
                source.Last = seq;
            }
            else if (source.LateTo == last && source.LateFrom <= seq && source.LateTo != 0)
            {
                source.LateFrom = seq + 1; // it was late, not lost
                Lost--;
            }
            else if (isAlone)
            {
                return false;
            }
            Received++;
            return true;
        }

        /// <summary>Return true if a message received before the echo will be repeated with the history: docs/wire.md, "Notices".</summary>
        public bool IsEarly(ulong publisher)
        {
            HeardPublisher source = Find(publisher);
            if (source == null || source.HasEchoed || source.IsHeard || source.Remote == null || source.Remote.Publisher.History <= 1)
            {
                return false;
            }
            source.EarlyUntilS = source.EarlyUntilS ?? Session.Clock.SteadyS + EarlyS;
            return Session.Clock.SteadyS < source.EarlyUntilS;
        }

        /// <summary>Handle an echo or a bye, sent after the messages up to <paramref name="seq"/>; return false if it is implausible.</summary>
        public bool Reached(ulong publisher, ulong seq)
        {
            HeardPublisher source = Get(publisher);
            source.IsHeard = true;
            if (source.Last != null && seq > source.Last && seq - source.Last > MaxGap)
            {
                return false;
            }
            if (source.Last != null && seq > source.Last)
            {
                Lost += (long)(seq - source.Last.Value);
            }
            if (source.Last == null || seq > source.Last)
            {
                source.Last = seq;
            }
            return true;
        }

        /// <summary>Handle the seq reported by the master; messages reported one renewal ago and not received are lost.</summary>
        public void PromisedBy(ulong publisher, ulong seq)
        {
            HeardPublisher source = Find(publisher);
            if (source == null || source.Last == null || seq > source.Last && seq - source.Last > MaxGap)
            {
                return;
            }
            if (source.Promised > source.Last)
            {
                if (source.LateTo != source.Last)
                {
                    source.LateFrom = source.Last.Value + 1;
                }
                Lost += (long)(source.Promised - source.Last.Value);
                source.Last = source.LateTo = source.Promised;
            }
            source.Promised = seq;
        }

        /// <summary>Count received messages that were dropped for lack of room as lost.</summary>
        public void Dropped(int count)
        {
            Received -= count;
            Lost += count;
        }

        /// <summary>Handle that a publisher has unregistered or was replaced; its last messages may still arrive.</summary>
        public void Closing(ulong publisher, ulong final)
        {
            HeardPublisher source = Find(publisher);
            if (source != null && source.EndsAtS == null)
            {
                source.EndsAtS = Session.Clock.SteadyS + FarewellS;
                source.Promised = Math.Max(source.Promised, final);
            }
        }

        public void Lapsed(ulong publisher, ulong final)
        {
            HeardPublisher source = Find(publisher);
            if (source != null)
            {
                source.IsLapsed = true;
                source.Promised = Math.Max(source.Promised, final);
            }
        }

        /// <summary>Count the reported messages that were not received as lost, before disconnecting from a publisher.</summary>
        public void Settle(ulong publisher)
        {
            HeardPublisher source = Find(publisher);
            if (source != null && source.Last != null)
            {
                Reached(publisher, source.Promised);
            }
        }

        /// <summary>Return publishers to disconnect from: their bye did not arrive, or there are too many silent ones.</summary>
        public List<ulong> Ended()
        {
            var silent = new List<ulong>();
            var ended = new List<ulong>();
            foreach (KeyValuePair<ulong, HeardPublisher> each in _byId)
            {
                if (each.Value.EndsAtS != null && Session.Clock.SteadyS >= each.Value.EndsAtS)
                {
                    ended.Add(each.Key);
                }
                else if (each.Value.EndsAtS == null && each.Value.IsLapsed)
                {
                    silent.Add(each.Key);
                }
            }
            ended.AddRange(silent.GetRange(0, Math.Max(0, silent.Count - MaxUnlisted)));
            return ended;
        }

        /// <summary>Return silent publishers whose program was restarted as <paramref name="remote"/>.</summary>
        public List<ulong> ReplacedBy(RemotePublisher remote)
        {
            var replaced = new List<ulong>();
            foreach (KeyValuePair<ulong, HeardPublisher> each in _byId)
            {
                bool isSameNode = each.Value.Remote != null && each.Value.Remote.NodeName == remote.NodeName;
                if (each.Value.IsLapsed && isSameNode && each.Key != remote.Publisher.Id)
                {
                    replaced.Add(each.Key);
                }
            }
            return replaced;
        }

        public int EchoingCount()
        {
            int count = 0;
            foreach (HeardPublisher each in _byId.Values)
            {
                count += each.HasEchoed ? 1 : 0;
            }
            return count;
        }
    }
}
