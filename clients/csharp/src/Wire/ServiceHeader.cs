using System;

namespace Nep.Wire
{
    /// <summary>First part of a call or reply of a service: see docs/services.md, "Calls and answers".</summary>
    internal struct ServiceHeader
    {
        public const int Size = 16;
        public const byte Call = 1;
        public const byte Answer = 2;
        public const byte Error = 3;
        public const byte Refused = 4;
        public const int MaxPayloadBytes = 1 << 26;

        public byte Kind;
        public ushort Codec;
        public uint TimeoutMs;
        public ulong Number;

        public byte[] ToBytes()
        {
            var bytes = new byte[Size];
            bytes[0] = 1;
            bytes[1] = Kind;
            LittleEndian.Write(bytes, 2, Codec, 2);
            LittleEndian.Write(bytes, 4, TimeoutMs, 4);
            LittleEndian.Write(bytes, 8, Number, 8);
            return bytes;
        }

        /// <summary>Read the header of a call (<paramref name="isCall"/> true) or a reply, which has two parts.</summary>
        /// <exception cref="WireException">The parts are malformed.</exception>
        public static ServiceHeader Read(byte[][] parts, bool isCall)
        {
            if (parts.Length != 2 || parts[0].Length != Size)
            {
                throw new WireException("call-parts");
            }
            byte[] from = parts[0];
            if (from[0] != 1)
            {
                throw new WireException("call-version");
            }
            if (isCall ? from[1] != Call : from[1] < Answer || from[1] > Refused)
            {
                throw new WireException("call-kind");
            }
            var header = new ServiceHeader();
            header.Kind = from[1];
            header.Codec = (ushort)LittleEndian.Read(from, 2, 2);
            header.TimeoutMs = (uint)LittleEndian.Read(from, 4, 4);
            header.Number = LittleEndian.Read(from, 8, 8);
            return header;
        }
    }
}
