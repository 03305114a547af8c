using System;
using System.Collections.Generic;
using System.Threading;

namespace Nep
{
    /// <summary>Starts the background threads of the library and waits for them when the process exits.</summary>
    /// <remarks>
    /// Mono 6.8 aborts the process if a background thread throws an exception while the runtime shuts down, as a reader does
    /// whose socket is closed.
    /// </remarks>
    internal static class BackgroundThread
    {
        /// <summary>Stack size of threads that run no callbacks.</summary>
        public const int SmallStackBytes = 256 * 1024;

        private static readonly List<Thread> Running = new List<Thread>();

        /// <summary>Start a thread; <paramref name="stackBytes"/> 0 is the platform's default.</summary>
        public static Thread Start(string name, ThreadStart run, int stackBytes)
        {
            var thread = new Thread(run, stackBytes) { IsBackground = true, Name = "nep " + name };
            lock (Running)
            {
                Running.RemoveAll(each => !each.IsAlive);
                Running.Add(thread);
                thread.Start();
            }
            return thread;
        }

        /// <summary>Wait until all threads have ended; return false after the timeout.</summary>
        public static bool JoinAll(int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            Thread[] threads;
            lock (Running)
            {
                threads = Running.ToArray();
            }
            bool allEnded = true;
            foreach (Thread each in threads)
            {
                bool isOwn = each == Thread.CurrentThread; // a callback may exit the process
                allEnded &= isOwn || each.Join(deadline.LeftMs);
            }
            return allEnded;
        }
    }
}
