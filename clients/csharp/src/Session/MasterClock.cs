using System.Collections.Generic;
using Nep.Wire;

namespace Nep.Session
{
    /// <summary>The clock of a master as renewals tell of it: docs/wire.md, "Clocks". Thread-safe.</summary>
    internal sealed class MasterClock
    {
        private static readonly long ResolutionNs = Clock.MeasureResolutionNs();
        private readonly ClockSamples _samples = new ClockSamples(() => (long)Clock.NowNs, () => Clock.SteadyNs, ResolutionNs);

        /// <summary>This moment, for <see cref="Compare"/>.</summary>
        public Moment Now()
        {
            lock (_samples)
            {
                return _samples.Now();
            }
        }

        /// <summary>Field <c>clock</c> of a renewal: offset and uncertainty, or empty when they are unknown.</summary>
        public List<object> Field()
        {
            lock (_samples)
            {
                long offsetNs, uncertaintyNs;
                return _samples.TryGetOffset(out offsetNs, out uncertaintyNs) ? new List<object> { offsetNs, uncertaintyNs } : new List<object>();
            }
        }

        /// <summary>Take the times of a renewal that was sent and answered at these moments; true when the offset was unknown before.</summary>
        /// <exception cref="WireException">The field <c>times</c> is no list of integers.</exception>
        public bool Compare(Fields answer, Moment sent, Moment received)
        {
            List<long> times = answer.Integers("times");
            if (times.Count != 2)
            {
                return false; // the master has the same clock, or compares none
            }
            lock (_samples)
            {
                long ignored;
                bool wasKnown = _samples.TryGetOffset(out ignored, out ignored);
                return _samples.Add(sent, times[0], times[1], received) && !wasKnown;
            }
        }

        /// <summary>Another master may have another clock.</summary>
        public void Forget()
        {
            lock (_samples)
            {
                _samples.Forget();
            }
        }

        /// <summary>How clocks differ from this computer's, by node, as a renewal's answer tells; impossible differences are left out.</summary>
        /// <exception cref="WireException">The field <c>clocks</c> is none.</exception>
        public static Dictionary<string, ClockDifference> DifferencesIn(Fields answer)
        {
            var differences = new Dictionary<string, ClockDifference>();
            foreach (KeyValuePair<string, List<long>> each in answer.IntegersByText("clocks"))
            {
                List<long> told = each.Value; // the sums of two clocks
                if (told.Count == 2 && ClockDifference.IsPossible(told[0] / 2, told[1] / 2))
                {
                    differences[each.Key] = new ClockDifference(told[0], told[1], Clock.SteadyNs);
                }
            }
            return differences;
        }
    }
}
