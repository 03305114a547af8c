using System;
using System.Collections.Generic;

namespace Nep.Zmtp
{
    /// <summary>Message encoded as frames, which may be queued for several connections. Immutable.</summary>
    internal sealed class EncodedMessage
    {
        private const int CopyBelowBytes = 16384;

        private EncodedMessage(ArraySegment<byte>[] segments, long bytes)
        {
            Segments = segments;
            Bytes = bytes;
        }

        public ArraySegment<byte>[] Segments { get; private set; }

        public long Bytes { get; private set; }

        public static EncodedMessage Message(params byte[][] parts)
        {
            var segments = new ArraySegment<byte>[parts.Length];
            for (int i = 0; i < parts.Length; i++)
            {
                segments[i] = new ArraySegment<byte>(parts[i]);
            }
            return Message(segments);
        }

        public static EncodedMessage Message(ArraySegment<byte>[] parts)
        {
            long total = 0;
            for (int i = 0; i < parts.Length; i++)
            {
                total += HeadSize(parts[i].Count) + parts[i].Count;
            }
            if (total <= CopyBelowBytes)
            {
                return Copied(parts, (int)total, 0);
            }
            var segments = new List<ArraySegment<byte>>(2 * parts.Length);
            for (int i = 0; i < parts.Length; i++)
            {
                var head = new byte[HeadSize(parts[i].Count)];
                WriteHead(head, 0, parts[i].Count, i < parts.Length - 1 ? 1 : 0);
                segments.Add(new ArraySegment<byte>(head));
                if (parts[i].Count > 0)
                {
                    segments.Add(parts[i]);
                }
            }
            return new EncodedMessage(segments.ToArray(), total);
        }

        public static EncodedMessage Command(byte[] body)
        {
            return Copied(new[] { new ArraySegment<byte>(body) }, HeadSize(body.Length) + body.Length, 4);
        }

        private static EncodedMessage Copied(ArraySegment<byte>[] parts, int total, int flags)
        {
            var buffer = new byte[total];
            int at = 0;
            for (int i = 0; i < parts.Length; i++)
            {
                at += WriteHead(buffer, at, parts[i].Count, flags | (i < parts.Length - 1 ? 1 : 0));
                if (parts[i].Count > 0)
                {
                    Buffer.BlockCopy(parts[i].Array, parts[i].Offset, buffer, at, parts[i].Count);
                }
                at += parts[i].Count;
            }
            return new EncodedMessage(new[] { new ArraySegment<byte>(buffer) }, total);
        }

        private static int HeadSize(int size)
        {
            return size < 256 ? 2 : 9;
        }

        private static int WriteHead(byte[] into, int at, int size, int flags)
        {
            if (size < 256)
            {
                into[at] = (byte)flags;
                into[at + 1] = (byte)size;
                return 2;
            }
            into[at] = (byte)(flags | 2);
            for (int i = 8; i >= 1; i--)
            {
                into[at + i] = (byte)size;
                size >>= 8;
            }
            return 9;
        }
    }
}
