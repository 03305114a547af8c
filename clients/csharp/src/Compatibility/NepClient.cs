using System;
using System.ComponentModel;
using System.Globalization;
using System.Text;
using System.Threading;
using Nep.Zmtp;

namespace Nep
{
    /// <summary>Client of a server of the original library: one request, one answer. New programs use <see cref="Client"/>.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public sealed class NepClient : IDealerOwner, IDisposable
    {
        private readonly object _lock = new object();
        private readonly DealerSocket _socket;
        private byte[] _request;
        private string _answer;
        private bool _isWaiting;
        private bool _isClosed;

        /// <summary>Connect to a server.</summary>
        /// <param name="ip">Its address.</param>
        /// <param name="port">Its port.</param>
        /// <exception cref="ArgumentException">They are no address and port.</exception>
        public NepClient(string ip, int port)
        {
            ZmtpEndpoint endpoint;
            if (!ZmtpEndpoint.TryParse(ZmtpEndpoint.Format(ip, port), out endpoint))
            {
                throw new ArgumentException("'" + ip + ":" + port + "' is no address and port.", "ip");
            }
            _socket = new DealerSocket(endpoint, this, new ZmtpLimits { MaxMessageBytes = 64L << 20 }, NullMechanism.Create);
            _socket.Start();
        }

        /// <summary>Connect to a server.</summary>
        /// <param name="ip">Its address.</param>
        /// <param name="port">Its port as text.</param>
        public NepClient(string ip, string port) : this(ip, int.Parse(port, CultureInfo.InvariantCulture))
        {
        }

        /// <summary>Send a request as JSON; it is sent when the server can be reached.</summary>
        /// <exception cref="InvalidOperationException">The answer to the last request was not read.</exception>
        public void SendInfo(object message)
        {
            byte[] request = Encoding.UTF8.GetBytes(Json.Serializer.Serialize(message));
            lock (_lock)
            {
                if (_isClosed)
                {
                    throw new ObjectDisposedException("NepClient");
                }
                if (_isWaiting)
                {
                    throw new InvalidOperationException("Read the answer with ListenInfo() before the next request.");
                }
                _isWaiting = true;
                _request = request;
                SendPending();
            }
        }

        /// <summary>Wait for the answer and return its JSON; empty when the client was closed.</summary>
        /// <exception cref="InvalidOperationException">No request was sent.</exception>
        public string ListenInfo()
        {
            lock (_lock)
            {
                if (!_isWaiting)
                {
                    throw new InvalidOperationException("Send a request with SendInfo() first.");
                }
                while (_answer == null && !_isClosed)
                {
                    Monitor.Wait(_lock);
                }
                string answer = _answer ?? "";
                _answer = null;
                _isWaiting = false;
                return answer;
            }
        }

        /// <summary>Close; a waiting <see cref="ListenInfo"/> returns an empty text.</summary>
        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                Monitor.PulseAll(_lock);
            }
            _socket.Close(0);
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }

        void IDealerOwner.Connected()
        {
            lock (_lock)
            {
                SendPending();
            }
        }

        void IDealerOwner.Received(byte[][] parts)
        {
            lock (_lock)
            {
                // An empty part, then the body: the envelope of REQ and REP.
                if (parts.Length == 2 && parts[0].Length == 0 && _isWaiting && _request == null && _answer == null)
                {
                    _answer = Encoding.UTF8.GetString(parts[1]);
                    Monitor.PulseAll(_lock);
                }
            }
        }

        void IDealerOwner.Disconnected(string reason)
        {
        }

        private void SendPending()
        {
            if (_request != null && _socket.Send(new byte[0], _request))
            {
                _request = null;
            }
        }
    }
}
