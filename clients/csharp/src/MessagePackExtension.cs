namespace Nep
{
    /// <summary>A msgpack extension of a type that has no .NET type of its own.</summary>
    public sealed class MessagePackExtension
    {
        /// <summary>Create an extension value.</summary>
        /// <param name="type">Application's type number, -128 to 127; -1 is msgpack's timestamp.</param>
        /// <param name="data">Its bytes.</param>
        public MessagePackExtension(sbyte type, byte[] data)
        {
            Type = type;
            Data = data;
        }

        /// <summary>Type number.</summary>
        public sbyte Type { get; private set; }

        /// <summary>Bytes.</summary>
        public byte[] Data { get; private set; }
    }
}
