using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Threading;

namespace Nep.Zmtp
{
    /// <summary>Send queue of one connection. Bounded; drops the newest messages. Thread-safe.</summary>
    /// <remarks>
    /// The caller's thread writes as much as the socket accepts; the rest is written by a background thread, which is started on
    /// first use. It also writes bursts, with several messages per system call.
    /// </remarks>
    internal sealed class OutgoingQueue
    {
        private const int JoinBytes = 65536;
        private const int SendBufferBytes = 262144;

        /// <summary>Number of consecutive messages within <see cref="BurstTicks"/> of each other after which the thread takes over.</summary>
        private const int MinBurst = 8;

        /// <summary>Number of queued messages beyond which a caller waits a millisecond for the thread, unless the socket is full.</summary>
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
                // Send of Mono (6.8, also Unity's) busy-waits on a non-blocking socket until everything is sent. A writable socket has
                // a third of its buffer free, so chunks of an eighth always fit: docs/adr/0033-sending-under-mono.md.
                socket.SendBufferSize = SendBufferBytes;
                _maxChunk = Math.Max(2048, socket.SendBufferSize / 8);
            }
        }

        /// <summary>Number of messages dropped because the queue was full.</summary>
        public long Dropped { get; private set; }

        /// <summary>Number of bytes not yet accepted by the socket.</summary>
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

        /// <summary>Queue a message; return false if it was dropped.</summary>
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

        /// <summary>Wait until the socket has accepted all messages; return false after the timeout.</summary>
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

        /// <summary>Discard queued messages and end the thread.</summary>
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

        /// <summary>Write until the queue is empty (true) or the socket is full (false). Only one thread may write at a time.</summary>
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

        /// <summary>Dequeue the next message, or several small ones into one buffer; return false if the queue is empty.</summary>
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
