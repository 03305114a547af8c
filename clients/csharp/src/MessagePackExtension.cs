namespace Nep
{
    /// <summary>Value of a msgpack extension type without a corresponding .NET type.</summary>
    public sealed class MessagePackExtension
    {
        /// <summary>Create an extension value.</summary>
        /// <param name="type">Type number, -128 to 127; -1 is the timestamp of msgpack.</param>
        /// <param name="data">Content of the extension.</param>
        public MessagePackExtension(sbyte type, byte[] data)
        {
            Type = type;
            Data = data;
        }

        /// <summary>Type number.</summary>
        public sbyte Type { get; private set; }

        /// <summary>Content of the extension.</summary>
        public byte[] Data { get; private set; }
    }
}
