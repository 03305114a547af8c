using System;
using System.Diagnostics;
using System.Net;
using System.Net.Sockets;
using System.Text;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>TCP connection with ZMTP 3.0. One thread reads; any thread may send.</summary>
    internal sealed class Connection
    {
        private const int IdlePollMs = 1000;
        private static readonly string[] SocketTypes =
        {
            "PUB", "SUB", "XPUB", "XSUB", "REQ", "REP", "DEALER", "ROUTER", "PUSH", "PULL", "PAIR", "STREAM",
        };

        private readonly Socket _socket;
        private readonly ZmtpLimits _limits;
        private readonly string _socketType;
        private readonly IMechanism _mechanism;
        private readonly bool _isServer;
        private readonly FrameDecoder _decoder;
        private readonly OutgoingQueue _queue;
        private readonly bool _isFar;
        private readonly Stopwatch _sinceReceived = Stopwatch.StartNew();
        private readonly Stopwatch _sincePing = Stopwatch.StartNew();
        private bool _hasReceived;
        private int _isClosed;

        /// <summary>Create a connection from a connected socket, which it owns. Call <see cref="Handshake"/> first.</summary>
        public Connection(Socket socket, string socketType, bool isServer, ZmtpLimits limits, MechanismFactory mechanism)
        {
            _socket = socket;
            _socketType = socketType;
            _isServer = isServer;
            _limits = limits;
            _mechanism = mechanism(socketType, isServer);
            _decoder = new FrameDecoder(limits);
            _queue = new OutgoingQueue(socket, limits, OnWriteFailed);
            socket.NoDelay = true;
            socket.Blocking = false;
            var remote = socket.RemoteEndPoint as IPEndPoint;
            RemoteAddress = remote == null ? null : remote.Address;
            var local = socket.LocalEndPoint as IPEndPoint;
            LocalAddress = local == null ? null : local.Address;
            _isFar = limits.IsHeartbeatLocal || RemoteAddress != null && !IPAddress.IsLoopback(RemoteAddress);
        }

        /// <summary>Address of the peer.</summary>
        public IPAddress RemoteAddress { get; private set; }

        /// <summary>Local address of the connection.</summary>
        public IPAddress LocalAddress { get; private set; }

        /// <summary>Data of the owner.</summary>
        public object Tag { get; set; }

        public long QueuedBytes
        {
            get { return _queue.Bytes; }
        }

        public long Dropped
        {
            get { return _queue.Dropped; }
        }

        public bool IsClosed
        {
            get { return _isClosed != 0; }
        }

        /// <summary>Perform greeting and security handshake; blocks for at most <see cref="ZmtpLimits.HandshakeTimeoutMs"/>.</summary>
        /// <exception cref="ZmtpException">The peer is incompatible or violates the protocol.</exception>
        /// <exception cref="ConnectionClosedException">The peer closed the connection.</exception>
        public void Handshake()
        {
            var watch = Stopwatch.StartNew();
            SendRaw(Greeting.Create(_mechanism.Name, _isServer), watch);
            var greeting = new byte[Greeting.Size];
            int count = 0;
            while (count < greeting.Length)
            {
                try
                {
                    Fill(watch);
                }
                catch (ConnectionClosedException) when (count >= Greeting.SignatureSize)
                {
                    // libzmq with another mechanism closes the connection without sending its own.
                    throw new ZmtpException("refused-by-peer", "it closed the connection during the handshake; it may require encryption or a password");
                }
                count += _decoder.Peek(greeting, count, greeting.Length - count);
                Greeting.Check(greeting, count, _mechanism.Name);
            }
            while (!_mechanism.IsReady)
            {
                for (byte[] command = _mechanism.NextCommand(); command != null; command = _mechanism.NextCommand())
                {
                    SendRaw(EncodedMessage.Command(command).Segments[0].Array, watch);
                }
                Frame frame = ReadFrame(watch);
                if (!frame.IsCommand)
                {
                    throw new ZmtpException("bad-handshake", "it sent a malformed handshake");
                }
                _mechanism.Receive(frame.Body);
            }
            CheckSocketType();
        }

        /// <summary>Wait for the next message and return its parts. Commands are handled meanwhile.</summary>
        /// <exception cref="ZmtpException">The peer violates the protocol or a limit.</exception>
        /// <exception cref="ConnectionClosedException">The connection ended.</exception>
        public byte[][] ReadMessage()
        {
            byte[][] parts = null;
            while (true)
            {
                Frame frame = ReadFrame(null);
                if (frame.IsCommand)
                {
                    byte[] subscription = OnCommand(frame.Body);
                    if (subscription != null)
                    {
                        return new[] { subscription };
                    }
                    continue;
                }
                if (parts == null && !frame.HasMore)
                {
                    return new[] { frame.Body };
                }
                Array.Resize(ref parts, parts == null ? 1 : parts.Length + 1);
                parts[parts.Length - 1] = frame.Body;
                if (!frame.HasMore)
                {
                    return parts;
                }
            }
        }

        /// <summary>Queue a message; return false if it was dropped.</summary>
        public bool Send(EncodedMessage message)
        {
            return _queue.Send(message);
        }

        /// <summary>Wait until the kernel has accepted all messages; return false after the timeout.</summary>
        public bool Flush(int timeoutMs)
        {
            return _queue.Flush(timeoutMs);
        }

        /// <summary>Close; the reader throws <see cref="ConnectionClosedException"/>. Thread-safe and idempotent.</summary>
        public void Close()
        {
            if (Interlocked.Exchange(ref _isClosed, 1) != 0)
            {
                return;
            }
            _queue.Close();
            try
            {
                _socket.Shutdown(SocketShutdown.Both); // wakes a polling reader
            }
            catch (SocketException)
            {
            }
            catch (ObjectDisposedException)
            {
            }
            _socket.Close();
        }

        private void OnWriteFailed(string reason)
        {
            Close();
        }

        private void CheckSocketType()
        {
            byte[] value;
            string theirs = _mechanism.PeerProperties.TryGetValue("Socket-Type", out value) ? Encoding.ASCII.GetString(value) : "";
            string[] allowed = _socketType == "DEALER" ? new[] { "ROUTER", "DEALER", "REP" }
                : _socketType == "SUB" ? new[] { "PUB", "XPUB" }
                : _socketType == "ROUTER" ? new[] { "DEALER", "REQ", "ROUTER" }
                : new[] { "SUB", "XSUB" };
            if (Array.IndexOf(allowed, theirs) < 0)
            {
                throw new ZmtpException("other-socket-type", "it is a " + (Array.IndexOf(SocketTypes, theirs) >= 0 ? theirs + " socket" : "socket of an unknown type"));
            }
        }

        /// <summary>Handle a command. SUBSCRIBE and CANCEL of ZMTP 3.1 are converted to the messages of 3.0.</summary>
        private byte[] OnCommand(byte[] body)
        {
            if (Commands.Is(body, "PING"))
            {
                _queue.Send(EncodedMessage.Command(Commands.Pong(body)));
            }
            else if (Commands.Is(body, "ERROR"))
            {
                throw new ZmtpException("refused-by-peer", "it reports an error: " + Commands.ErrorReason(body));
            }
            else if (Commands.Is(body, "SUBSCRIBE") || Commands.Is(body, "CANCEL"))
            {
                int at = body[0] + 1;
                var message = new byte[body.Length - at + 1];
                message[0] = body[0] == 9 ? (byte)1 : (byte)0;
                Buffer.BlockCopy(body, at, message, 1, body.Length - at);
                return message;
            }
            return null; // unknown commands are ignored, as specified
        }

        private Frame ReadFrame(Stopwatch handshake)
        {
            Frame frame;
            while (!_decoder.TryRead(out frame))
            {
                Fill(handshake);
            }
            return frame;
        }

        /// <summary>Wait for input, within the time limit of a handshake, and receive it.</summary>
        private void Fill(Stopwatch handshake)
        {
            ArraySegment<byte> buffer = _decoder.Buffer;
            try
            {
                while (true)
                {
                    SocketError error;
                    int count = _socket.Receive(buffer.Array, buffer.Offset, buffer.Count, SocketFlags.None, out error);
                    if (error == SocketError.Success)
                    {
                        if (count == 0)
                        {
                            throw new ConnectionClosedException("the peer closed the connection");
                        }
                        _decoder.Advance(count);
                        _hasReceived = true;
                        _sinceReceived.Restart();
                        return;
                    }
                    if (error != SocketError.WouldBlock && error != SocketError.Interrupted)
                    {
                        throw new ConnectionClosedException("receiving failed: " + error);
                    }
                    WaitForInput(handshake);
                }
            }
            catch (SocketException exception)
            {
                throw new ConnectionClosedException("receiving failed: " + exception.SocketErrorCode);
            }
            catch (ObjectDisposedException)
            {
                throw new ConnectionClosedException("this side closed the connection");
            }
        }

        private void WaitForInput(Stopwatch handshake)
        {
            int waitMs = _isFar && _limits.HeartbeatMs > 0 ? Math.Min(IdlePollMs, _limits.HeartbeatMs) : IdlePollMs;
            if (handshake != null)
            {
                waitMs = _limits.HandshakeTimeoutMs - (int)handshake.ElapsedMilliseconds;
                if (waitMs <= 0)
                {
                    throw HandshakeTimeout();
                }
                waitMs = Math.Min(waitMs, IdlePollMs);
            }
            bool isReadable = _socket.Poll(waitMs * 1000, SelectMode.SelectRead);
            if (!isReadable && handshake == null && _isFar && _limits.HeartbeatMs > 0)
            {
                Heartbeat();
            }
        }

        private ZmtpException HandshakeTimeout()
        {
            return new ZmtpException("handshake-timeout", _hasReceived ? "it sent an incomplete handshake" : "it sent nothing");
        }

        private void Heartbeat()
        {
            if (_sinceReceived.ElapsedMilliseconds > _limits.HeartbeatTimeoutMs)
            {
                throw new ConnectionClosedException("the peer was silent for too long");
            }
            if (_sinceReceived.ElapsedMilliseconds > _limits.HeartbeatMs && _sincePing.ElapsedMilliseconds > _limits.HeartbeatMs)
            {
                _sincePing.Restart();
                _queue.Send(EncodedMessage.Command(Commands.Ping(_limits.HeartbeatTimeoutMs)));
            }
        }

        private void SendRaw(byte[] bytes, Stopwatch handshake)
        {
            int sent = 0;
            try
            {
                while (sent < bytes.Length)
                {
                    SocketError error;
                    sent += _socket.Send(bytes, sent, bytes.Length - sent, SocketFlags.None, out error);
                    if (error == SocketError.WouldBlock)
                    {
                        if (handshake.ElapsedMilliseconds > _limits.HandshakeTimeoutMs)
                        {
                            throw HandshakeTimeout();
                        }
                        _socket.Poll(100000, SelectMode.SelectWrite);
                    }
                    else if (error != SocketError.Success && error != SocketError.Interrupted)
                    {
                        throw new ConnectionClosedException("sending failed: " + error);
                    }
                }
            }
            catch (SocketException exception)
            {
                throw new ConnectionClosedException("sending failed: " + exception.SocketErrorCode);
            }
            catch (ObjectDisposedException)
            {
                throw new ConnectionClosedException("this side closed the connection");
            }
        }
    }
}
