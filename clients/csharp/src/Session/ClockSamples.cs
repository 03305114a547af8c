using System;
using System.Collections.Generic;

namespace Nep.Session
{
    /// <summary>A moment by this computer's clock and by a monotonic clock.</summary>
    internal struct Moment
    {
        public long WallNs;
        public long SteadyNs;

        /// <summary>Maximum difference between the two readings.</summary>
        public long SlackNs;
    }

    /// <summary>Comparison of this computer's clock with the master's, from the times in renewals: docs/wire.md, "Clocks". Not thread-safe.</summary>
    internal sealed class ClockSamples
    {
        private const int MaxSamples = 8;
        private const long StepNs = 50000;
        private const long SlewParts = 2000; // a clock adjusted by slewing deviates by at most 1/2000

        private readonly Func<long> _wall;
        private readonly Func<long> _steady;
        private readonly long _resolutionNs;
        private readonly List<Sample> _samples = new List<Sample>();
        private Moment? _seen;

        /// <param name="wall">Clock of message stamps, in nanoseconds since 1970.</param>
        /// <param name="steady">Monotonic clock, in nanoseconds.</param>
        /// <param name="resolutionNs">Resolution of <paramref name="wall"/>.</param>
        public ClockSamples(Func<long> wall, Func<long> steady, long resolutionNs)
        {
            _wall = wall;
            _steady = steady;
            _resolutionNs = resolutionNs;
        }

        /// <summary>Return the current moment. Discards all samples if this computer's clock was set since the last call.</summary>
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

        /// <summary>Add a sample from the times of a renewal; return false if it is invalid.</summary>
        /// <param name="sent">When the renewal was sent.</param>
        /// <param name="receivedNs">When the master received it, by the master's clock.</param>
        /// <param name="answeredNs">When the master replied, by the master's clock.</param>
        /// <param name="now">When the reply was received.</param>
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
                _samples.Clear(); // contradiction: the master's clock was set
            }
            if (_samples.Count == MaxSamples)
            {
                _samples.RemoveAt(0);
            }
            _samples.Add(new Sample { OffsetNs = offsetNs, UncertaintyNs = uncertaintyNs, SteadyNs = now.SteadyNs });
            return true;
        }

        /// <summary>Get the offset from this computer's clock to the master's, and its uncertainty; return false if unknown.</summary>
        public bool TryGetOffset(out long offsetNs, out long uncertaintyNs)
        {
            Moment now = Now();
            Sample best = Best(now.SteadyNs);
            offsetNs = best == null ? 0 : best.OffsetNs;
            uncertaintyNs = best == null ? 0 : best.UncertaintyAt(now.SteadyNs);
            return best != null && uncertaintyNs <= ClockDifference.MaxUncertaintyNs;
        }

        /// <summary>Discard all samples: another master may have another clock.</summary>
        public void Forget()
        {
            _samples.Clear();
        }

        /// <summary>Return the mean of two numbers, rounded down, without overflow.</summary>
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

        /// <summary>Return true if both clocks advanced by the same time between two moments.</summary>
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
