using System;
using System.Diagnostics;

namespace Nep.Session
{
    /// <summary>Clocks of this computer: time in nanoseconds since 1970, and monotonic time.</summary>
    internal static class Clock
    {
        private static readonly long EpochTicks = new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc).Ticks;
        private static readonly Stopwatch Steady = Stopwatch.StartNew();

        public static double SteadyS
        {
            get { return Steady.Elapsed.TotalSeconds; }
        }

        /// <summary>Monotonic time in nanoseconds.</summary>
        public static long SteadyNs
        {
            get { return (long)(Stopwatch.GetTimestamp() * (1e9 / Stopwatch.Frequency)); }
        }

        /// <summary>Measure the resolution of <see cref="NowNs"/>: 16 ms with .NET Framework, otherwise microseconds.</summary>
        public static long MeasureResolutionNs()
        {
            ulong first = NextNs();
            return (long)(NextNs() - first);
        }

        private static ulong NextNs()
        {
            ulong begin = NowNs, now = begin;
            while (now <= begin)
            {
                now = NowNs;
            }
            return now;
        }

        public static ulong NowNs
        {
            get { return (ulong)(DateTime.UtcNow.Ticks - EpochTicks) * 100; }
        }

        public static DateTime ToDateTime(ulong ns)
        {
            long ticks = (long)Math.Min(ns / 100, (ulong)(DateTime.MaxValue.Ticks - EpochTicks));
            return new DateTime(EpochTicks + ticks, DateTimeKind.Utc);
        }
    }
}
