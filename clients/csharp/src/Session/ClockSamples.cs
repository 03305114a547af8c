using System;
using System.Collections.Generic;

namespace Nep.Session
{
    /// <summary>One moment by this computer's clock and by one that nobody sets.</summary>
    internal struct Moment
    {
        public long WallNs;
        public long SteadyNs;

        /// <summary>How far the two readings may be apart.</summary>
        public long SlackNs;
    }

    /// <summary>Compares this computer's clock with the master's by the times of renewals: docs/wire.md, "Clocks". Not thread-safe.</summary>
    internal sealed class ClockSamples
    {
        private const int MaxSamples = 8;
        private const long StepNs = 50000;
        private const long SlewParts = 2000; // a clock that is adjusted slowly; what goes faster was set

        private readonly Func<long> _wall;
        private readonly Func<long> _steady;
        private readonly long _resolutionNs;
        private readonly List<Sample> _samples = new List<Sample>();
        private Moment? _seen;

        /// <param name="wall">Clock of message stamps, in nanoseconds since 1970.</param>
        /// <param name="steady">Clock that nobody sets, in nanoseconds.</param>
        /// <param name="resolutionNs">Step of <paramref name="wall"/>.</param>
        public ClockSamples(Func<long> wall, Func<long> steady, long resolutionNs)
        {
            _wall = wall;
            _steady = steady;
            _resolutionNs = resolutionNs;
        }

        /// <summary>This moment. Forgets all samples when this computer's clock was set since the last one.</summary>
        public Moment Now()
        {
            long before = _steady();
            long wallNs = _wall();
            long after = _steady();
            var moment = new Moment { WallNs = wallNs, SteadyNs = before + (after - before) / 2, SlackNs = (after - before) / 2 + 1 };
            if (_seen != null && !Fits(_seen.Value, moment))
            {
                _samples.Clear();
            }
            _seen = moment;
            return moment;
        }

        /// <summary>A renewal was sent, received and answered by the master at its times, and its answer came; whether that is of use.</summary>
        public bool Add(Moment sent, long receivedNs, long answeredNs, Moment now)
        {
            long awayNs = now.SteadyNs - sent.SteadyNs - (answeredNs - receivedNs);
            bool isPossible = answeredNs >= receivedNs && awayNs >= -now.SlackNs - sent.SlackNs;
            if (!isPossible || !Fits(sent, now))
            {
                return false;
            }
            long offsetNs = Middle(receivedNs - sent.WallNs, answeredNs - now.WallNs);
            long uncertaintyNs = Math.Max(0, awayNs) / 2 + _resolutionNs + now.SlackNs + sent.SlackNs;
            if (!ClockDifference.IsPossible(offsetNs, uncertaintyNs))
            {
                return false;
            }
            Sample best = Best(now.SteadyNs);
            if (best != null && Math.Abs((decimal)offsetNs - best.OffsetNs) > uncertaintyNs + best.UncertaintyAt(now.SteadyNs))
            {
                _samples.Clear(); // both can't be true: the master's clock was set
            }
            if (_samples.Count == MaxSamples)
            {
                _samples.RemoveAt(0);
            }
            _samples.Add(new Sample { OffsetNs = offsetNs, UncertaintyNs = uncertaintyNs, SteadyNs = now.SteadyNs });
            return true;
        }

        /// <summary>What to add to this computer's time to get the master's, and its uncertainty; false when that is unknown.</summary>
        public bool TryGetOffset(out long offsetNs, out long uncertaintyNs)
        {
            Moment now = Now();
            Sample best = Best(now.SteadyNs);
            offsetNs = best == null ? 0 : best.OffsetNs;
            uncertaintyNs = best == null ? 0 : best.UncertaintyAt(now.SteadyNs);
            return best != null && uncertaintyNs <= ClockDifference.MaxUncertaintyNs;
        }

        /// <summary>Another master may have another clock.</summary>
        public void Forget()
        {
            _samples.Clear();
        }

        /// <summary>Mean of two numbers, rounded down, without overflow.</summary>
        private static long Middle(long one, long two)
        {
            return (one & two) + ((one ^ two) >> 1);
        }

        private Sample Best(long steadyNs)
        {
            Sample best = null;
            foreach (Sample each in _samples)
            {
                best = best == null || each.UncertaintyAt(steadyNs) < best.UncertaintyAt(steadyNs) ? each : best;
            }
            return best;
        }

        /// <summary>Whether both clocks went on by as much since then.</summary>
        private bool Fits(Moment then, Moment now)
        {
            long bySteady = now.SteadyNs - then.SteadyNs;
            long allowed = StepNs + then.SlackNs + now.SlackNs + 2 * _resolutionNs + Math.Max(0, bySteady) / SlewParts;
            return Math.Abs((decimal)now.WallNs - then.WallNs - bySteady) <= allowed;
        }

        private sealed class Sample
        {
            public long OffsetNs;
            public long UncertaintyNs;
            public long SteadyNs;

            public long UncertaintyAt(long steadyNs)
            {
                return UncertaintyNs + ClockDifference.DriftNs(steadyNs - SteadyNs);
            }
        }
    }
}
