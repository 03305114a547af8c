using System;
using System.Collections.Generic;
using System.Text;

namespace Nep.Wire
{
    /// <summary>Decoder of msgpack to plain values. Integers are long, or ulong beyond its range; at most 64 levels.</summary>
    internal sealed class MessagePackReader
    {
        public const int MaxLevels = 64;
        private static readonly long EpochTicks = new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc).Ticks;

        private readonly byte[] _data;
        private readonly int _end;
        private int _at;

        private MessagePackReader(ArraySegment<byte> data)
        {
            _data = data.Array;
            _at = data.Offset;
            _end = data.Offset + data.Count;
        }

        /// <summary>Decode the single value in <paramref name="data"/>.</summary>
        /// <exception cref="FormatException">The data is malformed or has trailing bytes.</exception>
        public static object ReadOnly(ArraySegment<byte> data)
        {
            var reader = new MessagePackReader(data);
            object value = reader.ReadValue(0);
            if (reader._at != reader._end)
            {
                throw new FormatException("the msgpack value is followed by other bytes");
            }
            return value;
        }

        private object ReadValue(int level)
        {
            int type = Byte();
            if (type <= 0x7F)
            {
                return (long)type;
            }
            if (type >= 0xE0)
            {
                return (long)(sbyte)type;
            }
            if (type <= 0x8F)
            {
                return Map(type & 15, level);
            }
            if (type <= 0x9F)
            {
                return List(type & 15, level);
            }
            if (type <= 0xBF)
            {
                return Text(type & 31);
            }
            return ReadTyped(type, level);
        }

        private object ReadTyped(int type, int level)
        {
            switch (type)
            {
                case 0xC0: return null;
                case 0xC2: return false;
                case 0xC3: return true;
                case 0xC4: return Bytes((int)Number(1));
                case 0xC5: return Bytes((int)Number(2));
                case 0xC6: return Bytes(Count(Number(4)));
                case 0xC7: return Extension((int)Number(1));
                case 0xC8: return Extension((int)Number(2));
                case 0xC9: return Extension(Count(Number(4)));
                case 0xCA: return (double)BitConverter.ToSingle(Reversed(4), 0);
                case 0xCB: return BitConverter.Int64BitsToDouble((long)Number(8));
                case 0xCC: return (long)Number(1);
                case 0xCD: return (long)Number(2);
                case 0xCE: return (long)Number(4);
                case 0xCF:
                    ulong number = Number(8);
                    return number <= long.MaxValue ? (object)(long)number : number;
                case 0xD0: return (long)(sbyte)Number(1);
                case 0xD1: return (long)(short)Number(2);
                case 0xD2: return (long)(int)Number(4);
                case 0xD3: return (long)Number(8);
                case 0xD4: return Extension(1);
                case 0xD5: return Extension(2);
                case 0xD6: return Extension(4);
                case 0xD7: return Extension(8);
                case 0xD8: return Extension(16);
                case 0xD9: return Text((int)Number(1));
                case 0xDA: return Text((int)Number(2));
                case 0xDB: return Text(Count(Number(4)));
                case 0xDC: return List((int)Number(2), level);
                case 0xDD: return List(Count(Number(4)), level);
                case 0xDE: return Map((int)Number(2), level);
                case 0xDF: return Map(Count(Number(4)), level);
                default: throw new FormatException("unknown msgpack type");
            }
        }

        private int Byte()
        {
            Need(1);
            return _data[_at++];
        }

        private ulong Number(int bytes)
        {
            Need(bytes);
            ulong value = 0;
            for (int i = 0; i < bytes; i++)
            {
                value = value << 8 | _data[_at++];
            }
            return value;
        }

        private byte[] Reversed(int count)
        {
            byte[] bytes = Bytes(count);
            if (BitConverter.IsLittleEndian)
            {
                Array.Reverse(bytes);
            }
            return bytes;
        }

        /// <summary>A size that what is left can hold, so that no memory is taken for a false one.</summary>
        private int Count(ulong told)
        {
            if (told > (ulong)(_end - _at))
            {
                throw new FormatException("the msgpack is truncated");
            }
            return (int)told;
        }

        private void Need(int count)
        {
            if (count > _end - _at)
            {
                throw new FormatException("the msgpack is truncated");
            }
        }

        private byte[] Bytes(int count)
        {
            Need(count);
            var bytes = new byte[count];
            Buffer.BlockCopy(_data, _at, bytes, 0, count);
            _at += count;
            return bytes;
        }

        private string Text(int count)
        {
            Need(count);
            try
            {
                string text = Names.StrictUtf8.GetString(_data, _at, count);
                _at += count;
                return text;
            }
            catch (DecoderFallbackException)
            {
                throw new FormatException("a msgpack string is not valid UTF-8");
            }
        }

        private List<object> List(int count, int level)
        {
            CheckLevel(level);
            Count((ulong)count);
            var list = new List<object>(Math.Min(count, 1024));
            for (int i = 0; i < count; i++)
            {
                list.Add(ReadValue(level + 1));
            }
            return list;
        }

        private Dictionary<object, object> Map(int count, int level)
        {
            CheckLevel(level);
            Count(2UL * (ulong)count);
            var map = new Dictionary<object, object>();
            for (int i = 0; i < count; i++)
            {
                object key = ReadValue(level + 1);
                if (key == null)
                {
                    key = MessagePackNil.Key;
                }
                map[key] = ReadValue(level + 1);
            }
            return map;
        }

        private static void CheckLevel(int level)
        {
            if (level >= MaxLevels)
            {
                throw new FormatException("lists and maps are nested more than 64 levels deep");
            }
        }

        private object Extension(int count)
        {
            var kind = (sbyte)Byte();
            Need(count);
            if (kind == -1 && (count == 4 || count == 8 || count == 12))
            {
                return Timestamp(count);
            }
            return new MessagePackExtension(kind, Bytes(count));
        }

        private object Timestamp(int count)
        {
            long seconds;
            ulong nanoseconds = 0;
            if (count == 4)
            {
                seconds = (long)Number(4);
            }
            else if (count == 8)
            {
                ulong both = Number(8);
                nanoseconds = both >> 34;
                seconds = (long)(both & 0x3FFFFFFFFUL);
            }
            else
            {
                nanoseconds = Number(4);
                seconds = (long)Number(8);
            }
            if (nanoseconds > 999999999 || seconds < -62135596800 || seconds > 253402300799)
            {
                throw new FormatException("a msgpack timestamp is out of range");
            }
            return new DateTime(EpochTicks + seconds * TimeSpan.TicksPerSecond + (long)(nanoseconds / 100), DateTimeKind.Utc);
        }
    }

    /// <summary>Key that represents nil in dictionaries.</summary>
    internal static class MessagePackNil
    {
        public static readonly object Key = new object();
    }
}
