using System;
using System.Threading;
using System.Threading.Tasks;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Client of one service, created by <see cref="Node.CreateClient"/>. Thread-safe; calls may overlap.</summary>
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

        /// <summary>Call the service and wait for its reply.</summary>
        /// <typeparam name="TAnswer">Type of the reply, as for <see cref="Message.As{T}"/>.</typeparam>
        /// <param name="request">Request, as for <see cref="Publisher.Publish"/>.</param>
        /// <param name="timeout">Maximum time to wait for a server and its reply; <see cref="Timeout.InfiniteTimeSpan"/> waits without a limit.</param>
        /// <exception cref="NoServerException">No server was reached before the timeout; nothing was sent.</exception>
        /// <exception cref="ServiceTimeoutException">The call was sent, and no reply arrived before the timeout.</exception>
        /// <exception cref="ServerGoneException">The server exited during the call.</exception>
        /// <exception cref="ServiceException">The server's callback threw an exception.</exception>
        /// <exception cref="RequestRefusedException">The server rejected the call.</exception>
        /// <exception cref="PayloadException">The request can't be encoded, or the reply can't be decoded.</exception>
        public TAnswer Call<TAnswer>(object request, TimeSpan timeout)
        {
            return Call<TAnswer>(request, timeout, CancellationToken.None);
        }

        /// <summary>Call the service without blocking the caller. See <see cref="Call{TAnswer}(object, TimeSpan)"/>.</summary>
        /// <typeparam name="TAnswer">Type of the reply.</typeparam>
        /// <param name="request">Request.</param>
        /// <param name="timeout">Maximum time to wait for a server and its reply.</param>
        /// <param name="cancellation">Ends the wait; the server may still execute the call.</param>
        public async Task<TAnswer> CallAsync<TAnswer>(object request, TimeSpan timeout, CancellationToken cancellation = default(CancellationToken))
        {
            using (cancellation.Register(_socket.Wake))
            {
                return await Task.Factory.StartNew(() => Call<TAnswer>(request, timeout, cancellation), cancellation,
                    TaskCreationOptions.LongRunning, TaskScheduler.Default).ConfigureAwait(false);
            }
        }

        /// <summary>Close the client; pending calls throw <see cref="ObjectDisposedException"/>.</summary>
        public void Dispose()
        {
            _node.Close(_socket);
        }

        private TAnswer Call<TAnswer>(object request, TimeSpan timeout, CancellationToken cancellation)
        {
            byte[] payload = _codec.Encode(request);
            if (payload.Length > ServiceHeader.MaxPayloadBytes)
            {
                throw new PayloadException("The request is larger than 64 MB.");
            }
            OutgoingCall call = _socket.Call(_codec.Number, payload, Node.TimeoutMs(timeout), cancellation);
            if (call.Kind != ServiceHeader.Answer)
            {
                throw ServiceFailure.Decode(call.Kind, call.Payload);
            }
            Codec codec = Codec.Numbered(call.Codec);
            if (codec == null)
            {
                throw new PayloadException("The reply has an unknown codec.");
            }
            return codec.Decode<TAnswer>(call.Payload);
        }
    }
}
