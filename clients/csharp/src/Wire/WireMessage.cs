using System;
using System.Collections.Generic;

namespace Nep.Wire
{
    /// <summary>Decoded message.</summary>
    internal struct WireMessage
    {
        public string Topic;
        public Header Header;
        public ArraySegment<byte> Payload;
        public Dictionary<string, object> Extension;
    }

    /// <summary>Decoder of messages, with the checks of docs/wire.md in their order.</summary>
    internal static class WireReader
    {
        public const int MaxBatch = 256;
        private const int MaxCodec = 5;

        /// <summary>Decode the messages in these parts: one, or those of a batch.</summary>
        /// <exception cref="WireException">The message violates the specification.</exception>
        public static List<WireMessage> Read(byte[][] parts)
        {
            int cut = CheckFirst(parts);
            string topic = Names.ReadTopicPart(parts[0], cut);
            return ReadRest(topic, parts, cut);
        }

        /// <summary>Return the size of the topic part, which may be the beginning of a single part.</summary>
        public static int CheckFirst(byte[][] parts)
        {
            if (parts.Length == 0)
            {
                throw new WireException("part-count");
            }
            if (parts.Length > 1)
            {
                return parts[0].Length;
            }
            int cut = Array.IndexOf(parts[0], (byte)0) + 1;
            if (cut == 0 || parts[0].Length < cut + Header.Size)
            {
                throw new WireException("part-count");
            }
            return cut;
        }

        /// <summary>Decode the messages after the topic part, which the caller has checked; <paramref name="cut"/> is its size.</summary>
        public static List<WireMessage> ReadRest(string topic, byte[][] parts, int cut)
        {
            bool isOnePart = parts.Length == 1;
            Header header = isOnePart ? Header.Read(parts[0], cut, Header.Size) : Header.Read(parts[1], 0, parts[1].Length);
            bool hasExtension = (header.Flags & Header.Extension) != 0;
            int count = isOnePart ? 3 : parts.Length;
            if (count != (hasExtension ? 4 : 3))
            {
                throw new WireException("part-count");
            }
            int at = cut + Header.Size;
            ArraySegment<byte> payload = isOnePart ? new ArraySegment<byte>(parts[0], at, parts[0].Length - at) : new ArraySegment<byte>(parts[2]);
            if ((header.Flags & Header.Batch) != 0)
            {
                return ReadBatch(topic, header, payload, isOnePart);
            }
            if (header.PayloadSize != 0 && header.PayloadSize != payload.Count)
            {
                throw new WireException("payload-size");
            }
            Dictionary<string, object> extension = hasExtension ? ReadExtension(parts[3]) : null;
            CheckCodec(header);
            return new List<WireMessage>(1) { new WireMessage { Topic = topic, Header = header, Payload = payload, Extension = extension } };
        }

        private static void CheckCodec(Header header)
        {
            if (header.Codec < 1 || header.Codec > MaxCodec)
            {
                throw new WireException("codec");
            }
        }

        private static Dictionary<string, object> ReadExtension(byte[] part)
        {
            try
            {
                var map = MessagePackReader.ReadOnly(new ArraySegment<byte>(part)) as Dictionary<object, object>;
                if (map != null)
                {
                    var named = new Dictionary<string, object>();
                    foreach (KeyValuePair<object, object> each in map)
                    {
                        named[(string)each.Key] = each.Value;
                    }
                    return named;
                }
            }
            catch (FormatException)
            {
            }
            catch (InvalidCastException)
            {
            }
            throw new WireException("extension");
        }

        private static List<WireMessage> ReadBatch(string topic, Header header, ArraySegment<byte> body, bool isOnePart)
        {
            if (!isOnePart || header.Flags != Header.Batch)
            {
                throw new WireException("batch-form");
            }
            if (header.PayloadSize != body.Count)
            {
                throw new WireException("payload-size");
            }
            ulong count = body.Count < 4 ? 0 : LittleEndian.Read(body.Array, body.Offset, 4);
            if (count < 1 || count > MaxBatch)
            {
                throw new WireException("batch-count");
            }
            int n = (int)count;
            int table = 4 + 12 * n;
            if (body.Count < table)
            {
                throw new WireException("batch-table");
            }
            long total = table;
            for (int i = 0; i < n; i++)
            {
                total += (long)LittleEndian.Read(body.Array, body.Offset + 4 + 4 * i, 4);
            }
            if (total != body.Count)
            {
                throw new WireException("batch-sizes");
            }
            CheckCodec(header);
            return SplitBatch(topic, header, body, n);
        }

        private static List<WireMessage> SplitBatch(string topic, Header header, ArraySegment<byte> body, int n)
        {
            var messages = new List<WireMessage>(n);
            int at = body.Offset + 4 + 12 * n;
            for (int i = 0; i < n; i++)
            {
                int size = (int)LittleEndian.Read(body.Array, body.Offset + 4 + 4 * i, 4);
                Header one = header;
                one.Flags = 0;
                one.Seq = unchecked(header.Seq + (ulong)i);
                one.StampNs = LittleEndian.Read(body.Array, body.Offset + 4 + 4 * n + 8 * i, 8);
                one.PayloadSize = (uint)size;
                messages.Add(new WireMessage { Topic = topic, Header = one, Payload = new ArraySegment<byte>(body.Array, at, size) });
                at += size;
            }
            return messages;
        }
    }
}
