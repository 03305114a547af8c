using System;
using System.ComponentModel;
using System.Globalization;
using System.Text;
using System.Threading;
using Nep.Zmtp;

namespace Nep
{
    /// <summary>Client of a server of the original library, with one request at a time. New programs use <see cref="Client"/>.</summary>
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
        /// <param name="ip">Address of the server.</param>
        /// <param name="port">Port of the server.</param>
        /// <exception cref="ArgumentException">The address or port is invalid.</exception>
        public NepClient(string ip, int port)
        {
            ZmtpEndpoint endpoint;
            if (!ZmtpEndpoint.TryParse(ZmtpEndpoint.Format(ip, port), out endpoint))
            {
                throw new ArgumentException("Invalid address or port '" + ip + ":" + port + "'.", "ip");
            }
            _socket = new DealerSocket(endpoint, this, new ZmtpLimits { MaxMessageBytes = 64L << 20 }, NullMechanism.Create);
            _socket.Start();
        }

        /// <summary>Connect to a server.</summary>
        /// <param name="ip">Address of the server.</param>
        /// <param name="port">Port of the server as text.</param>
        public NepClient(string ip, string port) : this(ip, int.Parse(port, CultureInfo.InvariantCulture))
        {
        }

        /// <summary>Send a request as JSON, as soon as the server is connected.</summary>
        /// <exception cref="InvalidOperationException">The reply to the previous request was not read.</exception>
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
                    throw new InvalidOperationException("Read the reply with ListenInfo() before the next request.");
                }
                _isWaiting = true;
                _request = request;
                SendPending();
            }
        }

        /// <summary>Wait for the reply and return its JSON; empty if the client was closed.</summary>
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

        /// <summary>Close the client; a waiting <see cref="ListenInfo"/> returns an empty string.</summary>
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
                // Envelope of REQ and REP: an empty part, then the body.
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
