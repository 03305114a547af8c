#define TRACE // without it compilers leave out calls of Trace, as Unity and plain mcs do

using System;
using System.Diagnostics;

namespace Nep
{
    /// <summary>Warnings for the program's trace listeners (<see cref="Trace.Listeners"/>).</summary>
    internal static class Log
    {
        /// <summary>Receives warnings instead of the trace listeners, in any thread; null for these.</summary>
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
