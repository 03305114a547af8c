#define TRACE // otherwise compilers omit calls of Trace, as Unity and mcs do by default

using System;
using System.Diagnostics;

namespace Nep
{
    /// <summary>Log that writes warnings to the program's trace listeners (<see cref="Trace.Listeners"/>).</summary>
    internal static class Log
    {
        /// <summary>Function that receives warnings, in any thread, instead of the trace listeners; null to use these.</summary>
        public static volatile Action<string> Sink;

        public static void Warning(string text)
        {
            Action<string> sink = Sink;
            if (sink == null)
            {
                Trace.TraceWarning("NEP: " + text);
            }
            else
            {
                sink("NEP: " + text);
            }
        }
    }
}
