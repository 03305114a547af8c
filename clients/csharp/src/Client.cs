using System;
using System.Threading;
using System.Threading.Tasks;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Calls one service. Created by <see cref="Node.CreateClient"/>. Thread-safe; any number of calls at once.</summary>
    /// <example><code>Sum answer = client.Call&lt;Sum&gt;(new { a = 2, b = 3 }, TimeSpan.FromSeconds(5));</code></example>
    public sealed class Client : IDisposable
    {
        private readonly Node _node;
        private readonly ClientSocket _socket;
        private readonly Codec _codec;

        internal Client(Node node, ClientSocket socket, Codec codec)
        {
            _node = node;
            _socket = socket;
            _codec = codec;
        }

        /// <summary>Call the service and wait for its answer.</summary>
        /// <typeparam name="TAnswer">Type of the answer, as for <see cref="Message.As{T}"/>.</typeparam>
        /// <param name="request">Request, as for <see cref="Publisher.Publish"/>.</param>
        /// <param name="timeout">Longest wait for a server and its answer; <see cref="Timeout.InfiniteTimeSpan"/> waits for ever.</param>
        /// <exception cref="NoServerException">No server was reached in time; nothing was sent.</exception>
        /// <exception cref="ServiceTimeoutException">It was sent, and no answer came in time.</exception>
        /// <exception cref="ServerGoneException">The server ended during the call.</exception>
        /// <exception cref="ServiceException">The server's callback failed.</exception>
        /// <exception cref="RequestRefusedException">The server did not carry it out.</exception>
        /// <exception cref="PayloadException">The request can't be sent, or the answer can't be read.</exception>
        public TAnswer Call<TAnswer>(object request, TimeSpan timeout)
        {
            return Call<TAnswer>(request, timeout, CancellationToken.None);
        }

        /// <summary>Call the service without blocking the caller. See <see cref="Call{TAnswer}(object, TimeSpan)"/>.</summary>
        /// <typeparam name="TAnswer">Type of the answer.</typeparam>
        /// <param name="request">Request.</param>
        /// <param name="timeout">Longest wait for a server and its answer.</param>
        /// <param name="cancellation">Ends the wait; the server may carry it out all the same.</param>
        public async Task<TAnswer> CallAsync<TAnswer>(object request, TimeSpan timeout, CancellationToken cancellation = default(CancellationToken))
        {
            using (cancellation.Register(_socket.Wake))
            {
                return await Task.Factory.StartNew(() => Call<TAnswer>(request, timeout, cancellation), cancellation,
                    TaskCreationOptions.LongRunning, TaskScheduler.Default).ConfigureAwait(false);
            }
        }

        /// <summary>Close; waiting calls end with <see cref="ObjectDisposedException"/>.</summary>
        public void Dispose()
        {
            _node.Close(_socket);
        }

        private TAnswer Call<TAnswer>(object request, TimeSpan timeout, CancellationToken cancellation)
        {
            byte[] payload = _codec.Encode(request);
            if (payload.Length > ServiceHeader.MaxPayloadBytes)
            {
                throw new PayloadException("A request has at most 64 MB.");
            }
            OutgoingCall call = _socket.Call(_codec.Number, payload, Node.TimeoutMs(timeout), cancellation);
            if (call.Kind != ServiceHeader.Answer)
            {
                throw ServiceFailure.Decode(call.Kind, call.Payload);
            }
            Codec codec = Codec.Numbered(call.Codec);
            if (codec == null)
            {
                throw new PayloadException("The answer has an unknown codec.");
            }
            return codec.Decode<TAnswer>(call.Payload);
        }
    }
}
