using System;
using System.Collections.Generic;
using Nep.Wire;
using Nep.Zmtp;

namespace Nep.Session
{
    /// <summary>One publisher as a subscriber hears it.</summary>
    internal sealed class HeardPublisher
    {
        public RemotePublisher Remote;
        public SubConnection Connection;

        /// <summary>Clock of its computer; its messages ask for it.</summary>
        public readonly PublisherClock Clock = new PublisherClock();

        /// <summary>Newest message that was received or counted as lost; null while unknown, 0 if all are still to come.</summary>
        public ulong? Last;

        /// <summary>Whether a message, an echo or a bye was received.</summary>
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

    /// <summary>The publishers that a subscriber hears, and how many messages were lost. It lives under its subscriber's lock.</summary>
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

        /// <summary>Count losses from the first message of a new publisher. Has no effect once it was heard.</summary>
        public void ExpectAllOf(ulong publisher)
        {
            HeardPublisher source = Get(publisher);
            source.Last = source.Last ?? 0;
        }

        /// <summary>Take over how the clocks of other computers' nodes differ; no others are known.</summary>
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

        /// <summary>A message arrived; false when it was heard already.</summary>
        /// <exception cref="WireException">More messages than anybody can miss would be missing before it.</exception>
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
                source.LateFrom = seq + 1; // it was only late
                Lost--;
            }
            else if (isAlone)
            {
                return false;
            }
            Received++;
            return true;
        }

        /// <summary>Whether a message comes again with the history that follows: see docs/wire.md, "Notices".</summary>
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

        /// <summary>Messages up to <paramref name="seq"/> were sent before this; false when that cannot be.</summary>
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

        /// <summary>The master says that <paramref name="seq"/> was sent; what was promised one renewal ago and has not come is lost.</summary>
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

        /// <summary>Messages that had been received were dropped for lack of room.</summary>
        public void Dropped(int count)
        {
            Received -= count;
            Lost += count;
        }

        /// <summary>A publisher has unregistered or was replaced; its last messages may still come.</summary>
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

        /// <summary>It is about to be left: what has not come of what was promised is lost.</summary>
        public void Settle(ulong publisher)
        {
            HeardPublisher source = Find(publisher);
            if (source != null && source.Last != null)
            {
                Reached(publisher, source.Promised);
            }
        }

        /// <summary>Publishers to leave: they closed long ago without a bye, or are the oldest of too many silent ones.</summary>
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

        /// <summary>Silent publishers whose program was started again.</summary>
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
