using System;

namespace Nep.Zmtp
{
    /// <summary>Frame of a connection.</summary>
    internal struct Frame
    {
        public byte[] Body;
        public bool HasMore;
        public bool IsCommand;
    }

    /// <summary>Decoder of frames from the bytes of a connection. Checks sizes before it allocates memory. Not thread-safe.</summary>
    /// <remarks>Receive into <see cref="Buffer"/>, call <see cref="Advance"/>, then <see cref="TryRead"/> until it returns false.</remarks>
    internal sealed class FrameDecoder
    {
        private const int ChunkBytes = 65536;
        private const int FirstBodyBytes = 8 << 20;

        private readonly ZmtpLimits _limits;
        private readonly byte[] _chunk = new byte[ChunkBytes];
        private int _begin;
        private int _end;
        private byte[] _body;
        private int _bodySize;
        private int _bodyFilled;
        private Frame _frame;
        private long _messageBytes;
        private int _parts;

        public FrameDecoder(ZmtpLimits limits)
        {
            _limits = limits;
        }

        /// <summary>Buffer for the next received bytes.</summary>
        public ArraySegment<byte> Buffer
        {
            get
            {
                if (_body != null && _begin == _end)
                {
                    if (_bodyFilled == _body.Length)
                    {
                        Array.Resize(ref _body, (int)Math.Min(_bodySize, 2L * _body.Length));
                    }
                    return new ArraySegment<byte>(_body, _bodyFilled, _body.Length - _bodyFilled);
                }
                if (_begin > 0)
                {
                    System.Buffer.BlockCopy(_chunk, _begin, _chunk, 0, _end - _begin);
                    _end -= _begin;
                    _begin = 0;
                }
                return new ArraySegment<byte>(_chunk, _end, _chunk.Length - _end);
            }
        }

        /// <summary>Report the number of bytes received into <see cref="Buffer"/>.</summary>
        public void Advance(int count)
        {
            if (_body != null && _begin == _end)
            {
                _bodyFilled += count;
            }
            else
            {
                _end += count;
            }
        }

        /// <summary>Read raw bytes before the first frame: the greeting.</summary>
        public int Peek(byte[] into, int at, int most)
        {
            int count = Math.Min(most, _end - _begin);
            System.Buffer.BlockCopy(_chunk, _begin, into, at, count);
            _begin += count;
            return count;
        }

        /// <summary>Read the next complete frame.</summary>
        /// <exception cref="ZmtpException">The frame is malformed or exceeds a limit.</exception>
        public bool TryRead(out Frame frame)
        {
            frame = default(Frame);
            if (_body == null && !ReadHead())
            {
                return false;
            }
            int count = Math.Min(_bodySize - _bodyFilled, _end - _begin);
            if (count > 0)
            {
                while (_body.Length < _bodyFilled + count)
                {
                    Array.Resize(ref _body, (int)Math.Min(_bodySize, 2L * _body.Length));
                }
                System.Buffer.BlockCopy(_chunk, _begin, _body, _bodyFilled, count);
                _begin += count;
                _bodyFilled += count;
            }
            if (_bodyFilled < _bodySize)
            {
                return false;
            }
            _frame.Body = _body;
            frame = _frame;
            _body = null;
            return true;
        }

        private bool ReadHead()
        {
            int available = _end - _begin;
            if (available < 2)
            {
                return false;
            }
            byte flags = _chunk[_begin];
            bool isLong = (flags & 2) != 0;
            bool isCommand = (flags & 4) != 0;
            bool hasMore = (flags & 1) != 0;
            if ((flags & 0xF8) != 0 || isCommand && hasMore || isCommand && _parts > 0)
            {
                throw new ZmtpException("bad-frame", "it sent a frame with unknown flags");
            }
            if (isLong && available < 9)
            {
                return false;
            }
            ulong size = isLong ? 0UL : _chunk[_begin + 1];
            for (int i = 1; isLong && i < 9; i++)
            {
                size = size << 8 | _chunk[_begin + i];
            }
            CheckSize(size, isCommand, hasMore);
            _begin += isLong ? 9 : 2;
            _frame.HasMore = hasMore;
            _frame.IsCommand = isCommand;
            _bodySize = (int)size;
            _bodyFilled = 0;
            _body = new byte[Math.Min(_bodySize, FirstBodyBytes)];
            return true;
        }

        private void CheckSize(ulong size, bool isCommand, bool hasMore)
        {
            if (isCommand)
            {
                if (size > (ulong)_limits.MaxCommandBytes)
                {
                    throw new ZmtpException("command-too-large", "it sent a command of " + size + " bytes");
                }
                return;
            }
            _parts++;
            if (_parts > _limits.MaxParts)
            {
                throw new ZmtpException("too-many-parts", "it sent a message of more than " + _limits.MaxParts + " parts");
            }
            if (size > 0x7FFFFFC7UL || _messageBytes + (long)size > _limits.MaxMessageBytes)
            {
                throw new ZmtpException("message-too-large", "it sent a message of more than " + _limits.MaxMessageBytes + " bytes");
            }
            _messageBytes += (long)size;
            if (!hasMore)
            {
                _parts = 0;
                _messageBytes = 0;
            }
        }
    }
}
