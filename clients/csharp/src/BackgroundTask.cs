using System;
using System.Threading;
using System.Threading.Tasks;

namespace Nep
{
    /// <summary>Blocking calls as tasks.</summary>
    internal static class BackgroundTask
    {
        /// <summary>Run a blocking call in a thread of its own.</summary>
        /// <param name="call">Call that looks at <paramref name="cancellation"/> when it is woken.</param>
        /// <param name="wake">Wakes the call.</param>
        /// <param name="cancellation">Ends the wait.</param>
        public static async Task<T> Run<T>(Func<T> call, Action wake, CancellationToken cancellation)
        {
            using (cancellation.Register(wake))
            {
                return await Task.Factory.StartNew(call, cancellation, TaskCreationOptions.LongRunning, TaskScheduler.Default)
                    .ConfigureAwait(false);
            }
        }
    }
}
