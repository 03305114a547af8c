using System;
using System.Threading;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Server of one service, created by <see cref="Node.CreateServer{TRequest, TAnswer}"/>.</summary>
    public sealed class Server : IDisposable
    {
        private readonly Node _node;
        private readonly ServerSocket _socket;
        private readonly Func<byte[], Codec, byte[]> _answer;

        internal Server(Node node, ServerSocket socket, Func<byte[], Codec, byte[]> answer, int threads)
        {
            _node = node;
            _socket = socket;
            _answer = answer;
            for (int i = 0; i < threads; i++)
            {
                BackgroundThread.Start("server " + Service, Run, 0);
            }
        }

        /// <summary>Name of the service.</summary>
        public string Service
        {
            get { return _socket.Record.Topic.Substring(Node.ServicePrefix.Length); }
        }

        /// <summary>Number of calls that were answered, including those that failed.</summary>
        public long Calls
        {
            get { return _socket.Calls; }
        }

        /// <summary>Number of calls whose callback threw an exception.</summary>
        public long Errors
        {
            get { return _socket.Errors; }
        }

        /// <summary>Number of rejected calls: malformed ones, or those received while the server was busy or closing.</summary>
        public long Refused
        {
            get { return _socket.Refused; }
        }

        /// <summary>Close the server: reject pending calls and wait for running callbacks, within <see cref="NodeOptions.CloseTimeout"/>.</summary>
        public void Dispose()
        {
            _node.Close(_socket);
        }

        private void Run()
        {
            for (IncomingCall call = _socket.Take(); call != null; call = _socket.Take())
            {
                byte kind = ServiceHeader.Answer;
                byte[] payload;
                try
                {
                    payload = _answer(call.Payload, Codec.Numbered(call.Header.Codec));
                }
                catch (RequestRefusedException exception)
                {
                    kind = ServiceHeader.Refused;
                    payload = ServiceFailure.Encode("", exception.Message);
                }
                catch (Exception exception) // passed to the client
                {
                    kind = ServiceHeader.Error;
                    payload = ServiceFailure.Encode(exception.GetType().Name, exception.Message);
                    _node.OnCallbackError(exception);
                }
                _socket.Answer(call, kind, payload);
            }
        }
    }
}
