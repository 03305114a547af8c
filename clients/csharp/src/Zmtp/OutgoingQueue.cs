using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>Messages on their way out of one connection. Bounded; drops the newest. Thread-safe.</summary>
    /// <remarks>
    /// The caller's thread writes as much as the socket takes at once; what is left is written by a thread that is
    /// started when it is first needed. That thread also writes bursts, many messages in one call of the system.
    /// </remarks>
    internal sealed class OutgoingQueue
    {
        private const int JoinBytes = 65536;
        private const int SendBufferBytes = 262144;

        /// <summary>After so many messages that follow each other within <see cref="BurstTicks"/> the thread takes over.</summary>
        private const int MinBurst = 8;

        /// <summary>A caller gives the thread a millisecond when so many messages wait although the socket takes them.</summary>
        private const int MaxAhead = 10000;

        private static readonly long BurstTicks = Stopwatch.Frequency * 20 / 1000000;
        private static readonly bool IsMono = !RuntimeInformation.FrameworkDescription.StartsWith(".NET", StringComparison.Ordinal);

        private readonly object _lock = new object();
        private readonly Queue<EncodedMessage> _waiting = new Queue<EncodedMessage>();
        private readonly Socket _socket;
        private readonly ZmtpLimits _limits;
        private readonly Action<string> _onFailure;
        private readonly int _maxChunk = int.MaxValue;
        private ArraySegment<byte>[] _current;
        private int _segment;
        private int _offset;
        private long _bytes;
        private long _sentAt;
        private int _burst;
        private bool _isBlocked;
        private bool _isWriting;
        private bool _threadMayWrite;
        private bool _hasThread;
        private bool _isClosed;

        public OutgoingQueue(Socket socket, ZmtpLimits limits, Action<string> onFailure)
        {
            _socket = socket;
            _limits = limits;
            _onFailure = onFailure;
            if (IsMono)
            {
                // Mono (6.8, also Unity's) spins in Send on a non-blocking socket until all is sent. A writable socket has a third of
                // its buffer free, so what is an eighth of it never meets a full one: docs/adr/0033-sending-under-mono.md.
                socket.SendBufferSize = SendBufferBytes;
                _maxChunk = Math.Max(2048, socket.SendBufferSize / 8);
            }
        }

        /// <summary>Messages that were dropped because the queue was full.</summary>
        public long Dropped { get; private set; }

        /// <summary>Bytes that the socket has not taken yet.</summary>
        public long Bytes
        {
            get
            {
                lock (_lock)
                {
                    return _bytes;
                }
            }
        }

        /// <summary>Queue a message; false when it was dropped.</summary>
        public bool Send(EncodedMessage message)
        {
            lock (_lock)
            {
                if (_waiting.Count >= MaxAhead && !_isBlocked && _threadMayWrite)
                {
                    Monitor.Wait(_lock, 1);
                }
                if (_isClosed)
                {
                    return false;
                }
                bool fits = _bytes <= _limits.AlwaysQueueBelowBytes || _bytes + message.Bytes <= _limits.MaxQueuedBytes;
                if (!fits || _waiting.Count >= _limits.MaxQueuedMessages)
                {
                    Dropped++;
                    return false;
                }
                _waiting.Enqueue(message);
                _bytes += message.Bytes;
                bool isBurst = IsBurst();
                if (_isWriting)
                {
                    return true;
                }
                _isWriting = true;
                if (isBurst)
                {
                    HandOver();
                    return true;
                }
            }
            if (!Write())
            {
                lock (_lock)
                {
                    _isBlocked = true;
                    HandOver();
                }
            }
            return true;
        }

        /// <summary>Wait until the socket has taken everything; false when it has not in time.</summary>
        public bool Flush(int timeoutMs)
        {
            var deadline = new Deadline(timeoutMs);
            lock (_lock)
            {
                while (_bytes > 0 && !_isClosed && !deadline.IsOver)
                {
                    deadline.Wait(_lock);
                }
                return _bytes == 0;
            }
        }

        /// <summary>Drop what waits and end the thread.</summary>
        public void Close()
        {
            lock (_lock)
            {
                _isClosed = true;
                _waiting.Clear();
                Monitor.PulseAll(_lock);
            }
        }

        private bool IsBurst()
        {
            long now = Stopwatch.GetTimestamp();
            _burst = now - _sentAt < BurstTicks ? Math.Min(MinBurst, _burst + 1) : 0;
            _sentAt = now;
            return _burst == MinBurst;
        }

        /// <summary>Write until there is nothing more (true) or the socket is full (false). The caller owns the writing.</summary>
        private bool Write()
        {
            try
            {
                while (_current != null || TakeNext())
                {
                    ArraySegment<byte> segment = _current[_segment];
                    if (_maxChunk < int.MaxValue && !_socket.Poll(0, SelectMode.SelectWrite))
                    {
                        return false;
                    }
                    SocketError error;
                    int size = Math.Min(_maxChunk, segment.Count - _offset);
                    int sent = _socket.Send(segment.Array, segment.Offset + _offset, size, SocketFlags.None, out error);
                    if (error == SocketError.WouldBlock || error == SocketError.NoBufferSpaceAvailable)
                    {
                        return false;
                    }
                    if (error == SocketError.Interrupted)
                    {
                        continue;
                    }
                    if (error != SocketError.Success)
                    {
                        Fail(error.ToString());
                        return true;
                    }
                    Written(sent, segment.Count);
                }
            }
            catch (ObjectDisposedException)
            {
                Fail("closed");
            }
            catch (SocketException exception)
            {
                Fail(exception.SocketErrorCode.ToString());
            }
            return true;
        }

        private void Written(int sent, int size)
        {
            _offset += sent;
            if (_offset == size)
            {
                _offset = 0;
                if (++_segment == _current.Length)
                {
                    _current = null;
                }
            }
            lock (_lock)
            {
                _bytes -= sent;
                if (_bytes == 0)
                {
                    Monitor.PulseAll(_lock);
                }
            }
        }

        /// <summary>The next message, or several small ones in one buffer; false ends the writing.</summary>
        private bool TakeNext()
        {
            lock (_lock)
            {
                if (_isClosed || _waiting.Count == 0)
                {
                    _isWriting = false;
                    _threadMayWrite = false;
                    Monitor.PulseAll(_lock);
                    return false;
                }
                _segment = 0;
                EncodedMessage first = _waiting.Dequeue();
                _current = IsSmall(first) && _waiting.Count > 0 && IsSmall(_waiting.Peek()) ? Join(first) : first.Segments;
                return true;
            }
        }

        private static bool IsSmall(EncodedMessage message)
        {
            return message.Segments.Length == 1 && message.Bytes < JoinBytes / 4;
        }

        private ArraySegment<byte>[] Join(EncodedMessage first)
        {
            var buffer = new byte[JoinBytes];
            int size = 0;
            EncodedMessage next = first;
            while (true)
            {
                ArraySegment<byte> from = next.Segments[0];
                Buffer.BlockCopy(from.Array, from.Offset, buffer, size, from.Count);
                size += from.Count;
                if (_waiting.Count == 0 || !IsSmall(_waiting.Peek()) || size + _waiting.Peek().Bytes > JoinBytes)
                {
                    return new[] { new ArraySegment<byte>(buffer, 0, size) };
                }
                next = _waiting.Dequeue();
            }
        }

        private void Fail(string reason)
        {
            lock (_lock)
            {
                _isClosed = true;
                _isWriting = false;
                _waiting.Clear();
                _current = null;
                Monitor.PulseAll(_lock);
            }
            _onFailure(reason);
        }

        private void HandOver()
        {
            _threadMayWrite = true;
            if (!_hasThread)
            {
                _hasThread = true;
                BackgroundThread.Start("writer", WriteInThread, BackgroundThread.SmallStackBytes);
            }
            Monitor.PulseAll(_lock);
        }

        private void WriteInThread()
        {
            while (true)
            {
                lock (_lock)
                {
                    while (!_threadMayWrite && !_isClosed)
                    {
                        Monitor.Wait(_lock);
                    }
                    if (_isClosed)
                    {
                        return;
                    }
                }
                try
                {
                    _socket.Poll(100000, SelectMode.SelectWrite);
                }
                catch (ObjectDisposedException)
                {
                    Fail("closed");
                    return;
                }
                catch (SocketException exception)
                {
                    Fail(exception.SocketErrorCode.ToString());
                    return;
                }
                bool isBlocked = !Write();
                lock (_lock)
                {
                    _isBlocked = isBlocked;
                }
            }
        }
    }
}
