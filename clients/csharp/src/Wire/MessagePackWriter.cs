using System;
using System.Collections;
using System.Collections.Generic;
using System.Globalization;

namespace Nep.Wire
{
    /// <summary>Encoder of plain values to msgpack: null, bool, integers, floats, string, byte[], DateTime, dictionaries and lists.</summary>
    internal sealed class MessagePackWriter
    {
        private static readonly long EpochTicks = new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc).Ticks;
        private byte[] _buffer = new byte[256];
        private int _size;

        /// <exception cref="NotSupportedException">A value can't be encoded or is nested too deep.</exception>
        public static byte[] Write(object value)
        {
            var writer = new MessagePackWriter();
            writer.Add(value, 0);
            var bytes = new byte[writer._size];
            Buffer.BlockCopy(writer._buffer, 0, bytes, 0, bytes.Length);
            return bytes;
        }

        private void Add(object value, int level)
        {
            if (level >= MessagePackReader.MaxLevels && (value is IDictionary || value is ICollection && !(value is byte[])))
            {
                throw new NotSupportedException("lists and maps are nested more than 64 levels deep");
            }
            if (value == null || value == MessagePackNil.Key)
            {
                Byte(0xC0);
            }
            else if (value is string)
            {
                Text((string)value);
            }
            else if (value is bool)
            {
                Byte((bool)value ? 0xC3 : 0xC2);
            }
            else if (value is ulong)
            {
                Unsigned((ulong)value);
            }
            else if (value is double || value is float || value is decimal)
            {
                Byte(0xCB);
                Number((ulong)BitConverter.DoubleToInt64Bits(Convert.ToDouble(value, CultureInfo.InvariantCulture)), 8);
            }
            else if (value is int || value is long || value is short || value is byte || value is uint || value is ushort || value is sbyte)
            {
                Signed(Convert.ToInt64(value, CultureInfo.InvariantCulture));
            }
            else
            {
                AddOther(value, level);
            }
        }

        private void AddOther(object value, int level)
        {
            if (value is byte[])
            {
                var bytes = (byte[])value;
                Head(bytes.Length, 0xC4, 0xC5, 0xC6);
                Raw(bytes);
            }
            else if (value is DateTime)
            {
                Timestamp(((DateTime)value).ToUniversalTime());
            }
            else if (value is MessagePackExtension)
            {
                var extension = (MessagePackExtension)value;
                Head(extension.Data.Length, 0xC7, 0xC8, 0xC9);
                Byte((byte)extension.Type);
                Raw(extension.Data);
            }
            else if (value is IDictionary)
            {
                var map = (IDictionary)value;
                Head(map.Count, 0x80, 15, 0xDE);
                foreach (DictionaryEntry each in map)
                {
                    Add(each.Key, level + 1);
                    Add(each.Value, level + 1);
                }
            }
            else if (value is ICollection)
            {
                var list = (ICollection)value;
                Head(list.Count, 0x90, 15, 0xDC);
                foreach (object each in list)
                {
                    Add(each, level + 1);
                }
            }
            else
            {
                throw new NotSupportedException("a value of type " + value.GetType().Name + " can't be encoded as msgpack");
            }
        }

        private void Byte(int value)
        {
            if (_size == _buffer.Length)
            {
                Array.Resize(ref _buffer, 2 * _buffer.Length);
            }
            _buffer[_size++] = (byte)value;
        }

        private void Number(ulong value, int bytes)
        {
            for (int i = bytes - 1; i >= 0; i--)
            {
                Byte((byte)(value >> 8 * i));
            }
        }

        private void Raw(byte[] bytes)
        {
            if (_buffer.Length - _size < bytes.Length)
            {
                Array.Resize(ref _buffer, Math.Max(2 * _buffer.Length, _size + bytes.Length));
            }
            Buffer.BlockCopy(bytes, 0, _buffer, _size, bytes.Length);
            _size += bytes.Length;
        }

        /// <summary>Write the type and size of a map or list (up to 15 in the first byte) or of bytes.</summary>
        private void Head(int count, int small, int medium, int large)
        {
            if (medium == 15)
            {
                if (count <= 15)
                {
                    Byte(small | count);
                }
                else
                {
                    Byte(count <= 0xFFFF ? large : large + 1);
                    Number((ulong)count, count <= 0xFFFF ? 2 : 4);
                }
                return;
            }
            Byte(count <= 0xFF ? small : count <= 0xFFFF ? medium : large);
            Number((ulong)count, count <= 0xFF ? 1 : count <= 0xFFFF ? 2 : 4);
        }

        private void Text(string text)
        {
            byte[] bytes = System.Text.Encoding.UTF8.GetBytes(text); // lone surrogates become U+FFFD
            if (bytes.Length <= 31)
            {
                Byte(0xA0 | bytes.Length);
            }
            else
            {
                Head(bytes.Length, 0xD9, 0xDA, 0xDB);
            }
            Raw(bytes);
        }

        private void Unsigned(ulong value)
        {
            if (value <= 0x7F)
            {
                Byte((int)value);
                return;
            }
            int bytes = value <= 0xFF ? 1 : value <= 0xFFFF ? 2 : value <= 0xFFFFFFFF ? 4 : 8;
            Byte(bytes == 1 ? 0xCC : bytes == 2 ? 0xCD : bytes == 4 ? 0xCE : 0xCF);
            Number(value, bytes);
        }

        private void Signed(long value)
        {
            if (value >= 0)
            {
                Unsigned((ulong)value);
            }
            else if (value >= -32)
            {
                Byte((byte)value);
            }
            else
            {
                int bytes = value >= sbyte.MinValue ? 1 : value >= short.MinValue ? 2 : value >= int.MinValue ? 4 : 8;
                Byte(bytes == 1 ? 0xD0 : bytes == 2 ? 0xD1 : bytes == 4 ? 0xD2 : 0xD3);
                Number((ulong)value, bytes);
            }
        }

        private void Timestamp(DateTime time)
        {
            long ticks = time.Ticks - EpochTicks;
            long seconds = ticks / TimeSpan.TicksPerSecond;
            long rest = ticks % TimeSpan.TicksPerSecond;
            if (rest < 0)
            {
                rest += TimeSpan.TicksPerSecond;
                seconds--;
            }
            Byte(0xC7);
            Byte(12);
            Byte(0xFF);
            Number((ulong)rest * 100, 4);
            Number((ulong)seconds, 8);
        }
    }
}
