using System;

namespace Nep.Wire
{
    /// <summary>Header of a message: 32 bytes before the payload.</summary>
    internal struct Header
    {
        public const int Size = 32;
        public const byte Version = 1;

        public const int Latched = 1;
        public const int Extension = 2;
        public const int Bye = 4;
        public const int Batch = 8;
        public const int Shared = 16;
        public const int Offer = 32;

        public byte Codec;
        public int Flags;
        public uint PayloadSize;
        public ulong Seq;
        public ulong StampNs;
        public ulong Publisher;

        public byte[] ToBytes()
        {
            var bytes = new byte[Size];
            Write(bytes, 0);
            return bytes;
        }

        public void Write(byte[] into, int at)
        {
            into[at] = Version;
            into[at + 1] = Codec;
            into[at + 2] = (byte)Flags;
            into[at + 3] = (byte)(Flags >> 8);
            LittleEndian.Write(into, at + 4, PayloadSize, 4);
            LittleEndian.Write(into, at + 8, Seq, 8);
            LittleEndian.Write(into, at + 16, StampNs, 8);
            LittleEndian.Write(into, at + 24, Publisher, 8);
        }

        /// <exception cref="WireException">The header has another size or version.</exception>
        public static Header Read(byte[] from, int at, int count)
        {
            if (count != Size)
            {
                throw new WireException("header-size");
            }
            if (from[at] != Version)
            {
                throw new WireException("version");
            }
            var header = new Header();
            header.Codec = from[at + 1];
            header.Flags = from[at + 2] | from[at + 3] << 8;
            header.PayloadSize = (uint)LittleEndian.Read(from, at + 4, 4);
            header.Seq = LittleEndian.Read(from, at + 8, 8);
            header.StampNs = LittleEndian.Read(from, at + 16, 8);
            header.Publisher = LittleEndian.Read(from, at + 24, 8);
            return header;
        }
    }

    /// <summary>Access to little-endian numbers in byte arrays, on any processor.</summary>
    internal static class LittleEndian
    {
        public static ulong Read(byte[] from, int at, int bytes)
        {
            ulong value = 0;
            for (int i = bytes - 1; i >= 0; i--)
            {
                value = value << 8 | from[at + i];
            }
            return value;
        }

        public static void Write(byte[] into, int at, ulong value, int bytes)
        {
            for (int i = 0; i < bytes; i++)
            {
                into[at + i] = (byte)value;
                value >>= 8;
            }
        }
    }
}
